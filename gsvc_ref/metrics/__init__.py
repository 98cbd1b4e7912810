"""The distance of two videos: PSNR, MS-SSIM and, where a plug-in has a meter, VMAF."""

from gsvc_ref.metrics.comparison import Comparison as Comparison
from gsvc_ref.metrics.comparison import FrameComparison as FrameComparison
from gsvc_ref.metrics.comparison import Vmaf as Vmaf
from gsvc_ref.metrics.comparison import VmafMeter as VmafMeter
from gsvc_ref.metrics.comparison import compare_frames as compare_frames
from gsvc_ref.metrics.squared_error import mse as mse
from gsvc_ref.metrics.squared_error import psnr as psnr
from gsvc_ref.metrics.squared_error import psnr_from_mse as psnr_from_mse
from gsvc_ref.metrics.ssim import ms_ssim as ms_ssim
from gsvc_ref.metrics.ssim import ms_ssim_scales as ms_ssim_scales
