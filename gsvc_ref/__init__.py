"""gsvc_ref: the readable CPU reference of GSVC, video as sums of 2D Gaussian splats.

    import gsvc_ref

    report = gsvc_ref.encode("clip.y4m", "clip.gsvc")           # or an array (T, H, W, 3), u1 or u2
    for frame in gsvc_ref.decode("clip.gsvc"):                  # (H, W, 3) u1, one at a time
        ...
    with gsvc_ref.open("clip.gsvc") as stream:
        for frame in stream.frames(30, 60):                     # starts decoding at the nearest I-frame
            frame.splats.positions, frame.bits
    for frame in gsvc_ref.decode("damaged.gsvc", on_gap=print): # all that is left, and what is missing
        ...
    gsvc_ref.concat(["morning.gsvc", "noon.gsvc"], "day.gsvc")  # one stream, without decoding a splat
    gsvc_ref.write("mine.gsvc", [parameters], 320, 240)         # splats of any trainer, an (N, 8) array for each frame

spec.md says what the bytes mean, `spec` is the code in it, and `bitstream`, `stream`, `main`, `paper` and `rendering`
do what it says; `training` has the paper's algorithms, `encoder` leads them from frame to frame, and `testing` has
Hypothesis strategies for those who test another implementation. What gsvc_tools adds, `concat`, `cut` and `write`,
it offers through `plugins`.

The operations of spec.md are here by their names, as fast functions with the arguments of section 4.3; `spec` has
their plain forms. Each takes and gives NumPy arrays, and a `Splats` is an array of its parameters:

    frames = gsvc_ref.decode_stream(data)                       # (T, H, W, 3) u1, all at once
    codes = gsvc_ref.read_stream(data)                          # what the bytes say, as flat arrays
    gsvc_ref.lsq_quantize(x, scale, offset, bits=6)             # the codes of spec.lsq_quantize(...)["codes"]
"""

from typing import Any

from gsvc_ref._lazy import lazily

__version__ = "0.1.0"


def _offered(name: str) -> Any:
    from gsvc_ref import plugins  # with entry points, for which no other name waits

    return plugins.offered(name)


__getattr__, __dir__, __all__ = lazily(__name__, gsvc_tools=_offered)
