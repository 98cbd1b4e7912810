"""The distance of two videos: PSNR, MS-SSIM and, where a plug-in has a meter, VMAF."""

from gsvc_ref.metrics.comparison import Comparison, FrameComparison, Vmaf, VmafMeter, compare_frames
from gsvc_ref.metrics.squared_error import mse, psnr, psnr_from_mse
from gsvc_ref.metrics.ssim import ms_ssim, ms_ssim_scales

__all__ = [
    "Comparison",
    "FrameComparison",
    "Vmaf",
    "VmafMeter",
    "compare_frames",
    "ms_ssim",
    "ms_ssim_scales",
    "mse",
    "psnr",
    "psnr_from_mse",
]
