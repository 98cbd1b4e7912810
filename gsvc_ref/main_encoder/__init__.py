"""The encoder of profile `main`.

`intra` makes I-frames and layers: `training.descent` finds splats in the coordinates of `training.coordinates`,
`training.edges` proposes new ones, `rounding` makes codes of them, and `density_choice` chooses how the codes are
written.
"""
