"""Files of splats that are no streams: NPZ, which keeps all that a stream has, and PLY as 3D Gaussian splatting has it.

`npz` and `ply` read and write the files; nothing is unpickled, and what a file claims is checked before anything is
allocated for it. `gaussians` makes 2D splats of 3D Gaussians and back, and says what gets lost.
"""

from gsvc_tools.splat_files.gaussians import from_gaussians, to_gaussians
from gsvc_tools.splat_files.npz import NpzSplats, write_npz
from gsvc_tools.splat_files.ply import read_ply, write_ply

__all__ = ["NpzSplats", "from_gaussians", "read_ply", "to_gaussians", "write_npz", "write_ply"]
