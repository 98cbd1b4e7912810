"""The encoder of profile `main`.

`coordinates` are what everything is measured in: changes of the same length cost the picture about the same. `intra`
makes I-frames and layers: `descent` finds splats, `edges` proposes new ones, `rounding` makes codes of them, and
`density_choice` chooses how the codes are written.
"""
