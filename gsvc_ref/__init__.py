"""gsvc_ref: the readable CPU reference of GSVC, video as sums of 2D Gaussian splats."""

__version__ = "0.1.0"
