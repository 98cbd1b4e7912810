"""The viewer on this machine: a server of its page, of a stream that may still grow, and of the source beside it.

In reading order: `pages` finds the files of the page, `streams` has the bytes of a file, of a growing file or of a
pipe, `source_frames` the frames of the source, `server` hands these out, on the loopback interface alone, and
`redirect_page` sends a browser to it.
"""
