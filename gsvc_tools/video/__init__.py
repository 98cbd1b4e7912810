"""Video files beyond y4m and pictures: through PyAV what FFmpeg knows, and animations for a web page.

`opening` loads the others when a file is opened. `libav` reads, with what `libav_probe` learns from a file before and
`pixel_layout` says of its samples; `libav_writer` writes copies to look at, with the sound that `libav_audio` copies;
`animation` writes GIF and WebP, and `webp` reads animated WebP, which FFmpeg does not. `resampling` makes videos
smaller or larger, and gives them another frame rate.
"""
