"""The fast renderer: splats are projected and binned to tiles, and threads sum them a tile at a time, in binary32.

In reading order: `tiles` lays out the memory, `exponential` evaluates the weight, and `projection` finds what the inner
loops need of a splat and the rows that it may cover. `binning` lists which splats touch which tile, and `batches`
gathers them from there. `sums` holds the inner loops, forward and backward, and `tile_pictures` copies between tiles
and pictures. `regions` finds what of a frame must be rendered again, `jobs` goes over the tiles, and `rasterizer` runs
jobs on `threads`.
"""
