"""The encoder of profile `main`.

`intra` makes I-frames and layers: `training.descent` finds splats for a `target` in the coordinates of
`training.coordinates`, `training.edges` proposes new ones, `rounding` makes codes of them, and `density_choice` chooses
how the codes are written. `inter` makes P-frames: `motion_field` moves the splats, `differences` changes them, and
`candidates` and `new_splats` add others. `settings` says how long each searches.
"""
