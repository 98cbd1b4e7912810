"""What CUDA's libraries do not tell of an NVIDIA GPU: the version of its driver."""

import subprocess


def driver() -> dict[str, str]:
    """The entry ``driver`` of an environment, from nvidia-smi; none where that is missing, as beside ROCm."""
    command = ["nvidia-smi", "--query-gpu=driver_version", "--format=csv,noheader"]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True)
    except (OSError, subprocess.SubprocessError):
        return {}
    return {"driver": run.stdout.splitlines()[0].strip()} if run.stdout.strip() else {}
