"""Decode a file of profile `main` to pixels on the device, and say how fast that was.

python -m gsvc_conformance.adapters.cuda clip.gsvc
python -m gsvc_conformance.adapters.cuda --deterministic clip.gsvc
"""

import argparse
import hashlib
import statistics
import sys
from pathlib import Path

from gsvc_conformance.adapters.cuda import device
from gsvc_conformance.adapters.cuda.decoder import Decoder, Room


def milliseconds(stream: bytes, room: Room | None = None, *, exact: bool) -> tuple[float, int, Room]:
    """The time from the first frame's bytes to the last one's pixels by events of the device, and how many frames."""
    decoder = Decoder(stream, exact=exact, room=room)
    start = decoder.room.reading.record()
    frames = sum(1 for _ in decoder.pictures())
    end = decoder.room.rendering.record()
    end.synchronize()
    return device.milliseconds(start, end), frames, decoder.room


def digest(stream: bytes) -> str:
    """The SHA-256 of the samples of all deterministic frames, one after the other."""
    found = hashlib.sha256()
    for picture in Decoder(stream, exact=True).pictures():
        found.update(picture.samples().tobytes())
    return found.hexdigest()


def main() -> int:
    """Run the command; 0 if the file was decoded."""
    parser = argparse.ArgumentParser(
        prog="python -m gsvc_conformance.adapters.cuda", description=__doc__.split("\n")[0]
    )
    parser.add_argument("file", type=Path, help="a .gsvc file")
    parser.add_argument(
        "--deterministic", action="store_true", help="as section 9.3 says; with the SHA-256 of all frames"
    )
    parser.add_argument("--times", type=int, default=5, metavar="N", help="decode N times, and take the median (5)")
    told = parser.parse_args()
    try:
        stream = told.file.read_bytes()
        print(", ".join(f"{name} {value}" for name, value in device.environment().items()))
        _, frames, room = milliseconds(stream, exact=told.deterministic)  # which compiles the kernels, and allocates
        times = [milliseconds(stream, room, exact=told.deterministic)[0] for _ in range(told.times)]
        rate = 1000 * frames / statistics.median(times)
        print(f"{told.file.name}: {frames} frames, {rate:,.0f} frames/s from the bytes to pixels on the device")
        if told.deterministic:
            print(f"sha256 {digest(stream)}")
    except Exception as error:  # a fault of the stream, no GPU, another profile: all of them are sentences
        print(f"{told.file}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
