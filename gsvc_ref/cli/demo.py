"""``gsvc demo``: encode the built-in clip, decode it in a second process, compare, and write a report."""

import subprocess
import sys
import time
from argparse import Namespace
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_ref.cli.arguments import whole
from gsvc_ref.cli.encode import kilobits_per_second, progress_callback
from gsvc_ref.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.cli.text import decibel, duration, plural
from gsvc_ref.errors import UsageError

if TYPE_CHECKING:
    from gsvc_ref.codec import EncodeReport
    from gsvc_ref.metrics import Comparison

COMMAND: Final = "gsvc demo"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "demo",
        help="encode, decode and compare a built-in clip; start here",
        description="Encode a built-in clip, decode it in a second process, compare, and write a report to look at.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("--output", default="demo", metavar="FOLDER", help="where to write (default: demo)")
    parser.add_argument("--splats", type=whole, metavar="N", help="splats of a frame (default: one for 40 pixels)")
    parser.add_argument("--frames", type=whole, default=40, metavar="K", help="length of the clip (default: 40 frames)")
    parser.add_argument("--threads", type=whole, metavar="T", help="threads to compute with")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Run the demo."""
    return 0
