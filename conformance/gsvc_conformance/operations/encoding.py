"""The operation of encoders: frames in, a stream out (spec.md section 13.9)."""

import io
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from gsvc_conformance.encoding import Array, Task
from gsvc_conformance.expectations import Encoding, Expectation, Rate
from gsvc_conformance.operation import Values, operation


def task_oracle(**inputs: Any) -> Mapping[str, Expectation]:
    """Any stream that does what the inputs ask for, and its size."""
    return {"stream": Encoding(Task(**inputs)), "bits": Rate("stream")}


@operation(
    "encoder",
    inputs="frames: u1|u2 (T, H, W, 3); bit_depth: int; frame_rate_numerator: int; frame_rate_denominator: int; "
    "splats: int; key_frame_interval: int; level: int; floor: float",
    outputs="stream: stream; bits: i8 ()",
    rules=("R-13-7", "R-13-8"),
    oracle=task_oracle,
)
def encode_video(
    frames: Array,
    bit_depth: int,
    frame_rate_numerator: int,
    frame_rate_denominator: int,
    splats: int,
    key_frame_interval: int,
    level: int,
    floor: float,
) -> Values:
    """A stream of some frames, with at most so many splats each, and the size of the stream in bits."""
    from gsvc_ref import Settings, encode
    from gsvc_ref.video.format import ColorDescription, VideoFormat

    height, width = frames.shape[1:3]
    rate = Fraction(frame_rate_numerator, frame_rate_denominator)
    video = VideoFormat(
        width, height, rate, bit_depth, "rgb", ColorDescription(2, 2, 0, full_range=True, chroma_location=0)
    )
    settings = Settings.quick(
        profile="paper", splats=splats, key_frames=key_frame_interval or "auto", precision="deterministic"
    )
    stream = io.BytesIO()
    report = encode((list(frames), video), stream, settings)
    if report.header.level > level:
        raise NotImplementedError(f"frames of this size need level {report.header.level}")
    return {"stream": stream.getvalue(), "bits": np.array(8 * report.file_bytes, np.int64)}
