"""Training: how the splats of a frame are found (paper sections 3.4 to 3.7).

`fit` is the loop. Around it: `adan` moves the parameters, `schedule` sets their rates, `convergence` ends it early,
`pruning` (GSP) removes splats, `augmentation` (GSA) adds some, `keyframes` (DKS) tells where a new start is better.
"""
