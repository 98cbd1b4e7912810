"""Errors of CUDA as sentences that say what to do."""

from typing import Final

FIBERS: Final = "GSVC_CUDA=fibers runs the kernels on the CPU"

NO_CUPY: Final = f"CuPy is not there: pip install 'gsvc-conformance[cuda]'; {FIBERS}"

NO_NVRTC: Final = (
    "CuPy finds no NVRTC, which compiles the kernels: pip install 'gsvc-conformance[cuda]', or install a CUDA toolkit"
)

ADVICE: Final = {
    ("NoDevice",): f"CUDA finds no NVIDIA GPU: see what `nvidia-smi` lists, and CUDA_VISIBLE_DEVICES; {FIBERS}",
    ("InsufficientDriver", "SystemDriverMismatch"): (
        "the NVIDIA driver is missing, or too old for this CuPy's CUDA: install a newer driver, or the CuPy of an "
        f"older CUDA; {FIBERS}"
    ),
    ("OutOfMemory", "MemoryAllocation"): (
        "the GPU has no memory left: end what else runs on it, or take a smaller frame or fewer splats"
    ),
    ("LaunchTimeout",): (
        "the watchdog of a display has ended a kernel: take a GPU without a display, or a smaller frame; this process "
        "has lost CUDA, so start another one for the rest"
    ),
    ("NoBinaryForGpu", "NoKernelImageForDevice"): (
        "the kernels were compiled for another GPU: empty the folder gsvc-cuda of your cache"
    ),
    ("DevicesUnavailable",): "another process has the GPU for itself: end it, or see the compute mode in `nvidia-smi`",
    ("",): (
        "CUDA has failed, and this process has lost it, so start another one for the rest; "
        "`compute-sanitizer` says more of a kernel that leaves its memory"
    ),
}
"""By parts of the names that the CUDA runtime and the driver give to errors, without their underscores."""


def advice(said: str) -> str:
    """What to do about an error of CUDA, and the error.

    Parameters
    ----------
    said
        Its name and description, such as ``CUDA_ERROR_LAUNCH_TIMEOUT: the launch timed out and was terminated``.
    """
    name = said.partition(":")[0].replace("_", "").lower()
    known = (advice for names, advice in ADVICE.items() if any(part.lower() in name for part in names))
    return f"{next(known)} ({said})"
