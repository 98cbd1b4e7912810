"""The renderer's machine: splats are binned into tiles, and threads sum them a tile at a time."""
