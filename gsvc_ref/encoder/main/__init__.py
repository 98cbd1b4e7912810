"""The encoder of profile `main`, to be read in this order.

`coordinates`, `descent` and `fitter` find float splats for a `target`. `intra` makes I-frames and layers of them:
refinement with the term of the bits, sequential rounding by `codes`, and `densities` of the codes; `pixels` makes those
of a few pixels. `inter` makes P-frames: `field` moves the splats, `differences` changes them, and `new_splats` adds
others. `frame` decides on splats and steps of each frame, `layers` does so for each layer, and `settings` says how long
each searches.
"""
