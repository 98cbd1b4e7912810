"""The options of ``gsvc encode``, and the settings that they make."""

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.arguments import (
    amount,
    amount_of_bytes,
    finite,
    frame_range,
    key_frames,
    lanes,
    numbers_of,
    whole,
)

if TYPE_CHECKING:
    from gsvc_ref import Settings

OVERRIDES: Final = (
    "splats", "psnr", "quality", "iterations", "key_frames", "low_latency", "frames", "seed", "threads", "precision",
    "device", "effects", "decisions", "cholesky_bits", "color_stages", "color_codewords", "lane_count", "index",
    "checksums", "paced", "profile", "layers", "layer_splats", "layers_base", "bitrate", "size", "mean_psnr", "vmaf",
)  # fmt: skip
"""Options that are settings of the same name; one that is not given leaves the preset's value."""


def add_options(parser: ArgumentParser) -> None:
    """Add all options to the parser of the command."""
    parser.add_argument(
        "--preset", choices=("quick", "slow", "paper"), default="quick",
        help="quick (default): some 10 to 250 steps a frame; slow: several times as many, fewer bits; paper: the "
        "settings of the paper, in profile paper, minutes a frame",
    )  # fmt: skip
    parser.add_argument(
        "--profile", choices=("main", "paper"),
        help="the coding tools of the stream: main (default), about a third of the bits; paper, the paper's quantisers",
    )  # fmt: skip
    rate = parser.add_argument_group("rate and quality")
    rate.add_argument("--splats", type=whole, metavar="N", help="splats of a frame, or the most with --psnr")
    rate.add_argument("--psnr", type=finite, metavar="DB", help="as few bits as keep each frame at this PSNR")
    rate.add_argument(
        "--bitrate", type=amount, metavar="RATE",
        help="bits per second of the whole file, as 500k (k, M, G are powers of 1000, Ki, Mi, Gi of 1024), within "
        "3 %% where that is possible; the clip is encoded at least twice, and --splats is the most of a frame",
    )  # fmt: skip
    rate.add_argument(
        "--size", type=amount_of_bytes, metavar="BYTES", help="the same by the bytes of the file, as 2M or 700Ki"
    )
    rate.add_argument(
        "--psnr-mean", type=finite, metavar="DB", dest="mean_psnr",
        help="this mean PSNR of all frames, with few splats: the clip is encoded up to five times",
    )  # fmt: skip
    rate.add_argument(
        "--vmaf", type=finite, metavar="V",
        help="this mean VMAF, as 93; the same way, with the extra bench",
    )  # fmt: skip
    rate.add_argument(
        "--layers", type=numbers_of(finite), nargs="?", const=2, metavar="DB,DB,...",
        help="quality layers of profile main: without a value two, the base with half of the splats, about as good as "
        "one layer, for some 3 %% more bits at equal PSNR; or up to 4 by the PSNR with the base, with layer 1, ..., as "
        "30,34; gsvc decode --layer shows and gsvc cut --layer keeps the lower ones",
    )  # fmt: skip
    rate.add_argument(
        "--layers-splats", type=numbers_of(whole), metavar="N,N,...", dest="layer_splats",
        help="the same by the number of splats with the base, with layer 1, ..., as 200,400,800; three take about "
        "twice as many bits more as two do",
    )  # fmt: skip
    rate.add_argument(
        "--layers-base", type=finite, metavar="W",
        help="how much the base's error counts against that of all layers, above 0 to 1 (default: 0.15 of two layers, "
        "0.1 of more): a higher one gives a base of fewer bits for its PSNR, and more bits for all layers",
    )  # fmt: skip
    rate.add_argument(
        "--quality", type=whole, metavar="Q",
        help="how fine all codes are, 0 (coarse) to 79; 8 more halve every step, and 10 to 40 are usual. Without "
        "--splats as many splats as go with it (profile main)",
    )  # fmt: skip
    rate.add_argument(
        "--iterations", type=whole, metavar="K",
        help="profile paper: iterations of fitting an I-frame; P-frames in proportion",
    )  # fmt: skip
    rate.add_argument("--cholesky-bits", type=whole, metavar="b", help="profile paper: bits of a Cholesky code, 1..12")
    rate.add_argument(
        "--color-stages", type=whole, metavar="M", help="profile paper: stages of the colour quantiser, 1..8"
    )
    rate.add_argument("--color-codewords", type=whole, metavar="B", help="profile paper: codewords of a stage, 1..1024")
    frames = parser.add_argument_group("frames")
    frames.add_argument("--frames", type=frame_range, metavar="A:B", help="encode frames A to B-1 only")
    frames.add_argument(
        "--key-frames", type=key_frames, metavar="auto|K|LIST",
        help="I-frames: auto (default; at cuts), every K frames, or listed as 0,12,40",
    )  # fmt: skip
    # With default=None an option that is not given leaves the preset's value.
    frames.add_argument(
        "--low-latency", action="store_true", default=None, help="decide I-frames without looking ahead"
    )
    frames.add_argument(
        "--effects", metavar="auto|all|...",
        help="what the encoder does: auto (default; where the scene calls for it), all (default of preset paper; on "
        "every frame), then switches by name, for instance auto,gsa=off,dks=all: frames = auto|all; gsa, motion = "
        "auto|off; dks = auto|all|off; profile paper alone: regions = auto|all; gsa, gsp = auto|all|off",
    )  # fmt: skip
    stream = parser.add_argument_group("stream")
    stream.add_argument(
        "--lanes", type=lanes, metavar="by-size|L", dest="lane_count",
        help="lanes of the entropy coder, which a decoder can take side by side: by-size (default; as many "
        "as cost 0.6 %% of the bits; by-size:P%% another share), or 1..4096; profile paper: 1 (default) to 64",
    )  # fmt: skip
    stream.add_argument(
        "--no-index", action="store_false", default=None, dest="index", help="leave out the index for seeking"
    )
    stream.add_argument(
        "--no-decisions", action="store_false", default=None, dest="decisions",
        help="leave out what was decided about each frame (gsvc info --decisions)",
    )  # fmt: skip
    stream.add_argument(
        "--live", action="store_true",
        help="write under the final name, frame by frame: the growing file can be decoded up to its last complete "
        "frame, also if the encoder is killed; for the least delay add --low-latency",
    )  # fmt: skip
    stream.add_argument("--checksums", action="store_true", default=None, help="add a checksum of each frame's splats")
    stream.add_argument(
        "--paced", action="store_true", default=None,
        help="keep the limits of a second, so that a player can promise to keep pace: an I-frame at least every four "
        "seconds; where a second has too much, the encode ends with an error",
    )  # fmt: skip
    other = parser.add_argument_group("other")
    other.add_argument(
        "--seed", type=whole, metavar="S", help="seed of all randomness; the same seed gives the same file"
    )
    other.add_argument("--threads", type=whole, metavar="T", help="threads of the CPU; the file is the same with any")
    other.add_argument(
        "--precision", choices=("fast", "deterministic"),
        help="fast (default), or deterministic: the file depends on the kind of CPU neither; about a quarter slower",
    )  # fmt: skip
    other.add_argument("--device", metavar="NAME", help="what fits splats: cpu (default), or cuda; other bytes")
    other.add_argument("--json", action="store_true", help="print the report as JSON, and only that")
    other.add_argument("--quiet", action="store_true", help="print nothing but errors")


def make_settings(arguments: Namespace) -> "Settings":
    """The preset with what the command line overrides."""
    from gsvc_ref import Settings

    given = {name: getattr(arguments, name) for name in OVERRIDES}
    overrides = {name: value for name, value in given.items() if value is not None}
    presets = {"quick": Settings.quick, "slow": Settings.slow, "paper": Settings.paper}
    return presets[arguments.preset](**overrides)
