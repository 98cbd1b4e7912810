"""Targets of a whole clip, for which it is encoded several times: a bit rate, a size, a mean PSNR or VMAF.

`targets` leads. `passes` encode the clip, from a source that `reading_again` can read again. For a bit rate or a size
`curves` say what groups of pictures cost, and `budget` keeps each to its plan; `means` looks for the number of
splats that reaches a mean. `trial` estimates time and size from a few frames, and `screen_content` tells text.
"""
