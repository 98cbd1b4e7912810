"""What a page about a `.gsvc` file tells, measured: one pass over the file and its source, and x264 at equal PSNR.

`material` goes through file and source, `peers` asks x264, `contents` puts all of it together for
`gsvc_lab.pages.report`, and `damaged` is the page of a file without a frame.
"""
