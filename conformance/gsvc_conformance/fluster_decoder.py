"""GSVC for fluster: put this file into fluster/decoders/.

``GSVC`` is your decoder: the variable GSVC_DECODER has a command that is run as ``COMMAND IN.gsvc OUT.raw``. It writes
the frames, rendered deterministically, as raw video: of each frame the planes G, B and R, each row by row; a sample has
one byte where the bit depth is 8, else two, the least significant first. In the suite ``GSVC-layers`` it is run as
``COMMAND IN.gsvc OUT.raw LAYER``, and shows all frames with their layers up to this one; layer 0 is the base. Exit
status 77 means that it does not support the stream. ``GSVC-spec`` is the decoder inside spec.md, if gsvc_conformance
is installed beside fluster.

Fluster's list of codecs has no GSVC, so the codec is NONE here and in the suites.
"""

import importlib.util
import os
import shlex
import shutil
import sys
from subprocess import CalledProcessError
from typing import Any, Dict, List, Optional  # noqa: UP035  # as old a Python as fluster's

from fluster.codec import Codec, OutputFormat
from fluster.decoder import Decoder, NotSupportedError, register_decoder
from fluster.utils import file_checksum, run_command

EXIT_UNSUPPORTED = 77


class CommandDecoder(Decoder):  # type: ignore[misc]  # fluster has no types
    """A command that is given the names of the stream and of the raw video."""

    codec = Codec.NONE

    def command(self) -> List[str]:  # noqa: UP006
        """The words of the command; none if it cannot be run."""
        raise NotImplementedError

    def check(self, verbose: bool) -> bool:
        """Whether the command can be run."""
        words = self.command()
        found = bool(words) and shutil.which(words[0]) is not None
        if verbose and not found:
            print(f"{self.name} cannot be run: {self.description}")
        return found

    def decode(
        self,
        input_filepath: str,
        output_filepath: str,
        output_format: OutputFormat,
        timeout: int,
        verbose: bool,
        keep_files: bool,
        optional_params: Optional[Dict[str, Any]] = None,  # noqa: UP006, UP045
    ) -> str:
        """Run the command; the MD5 of what it wrote."""
        layer = [str(optional_params["layer"])] if optional_params else []
        try:
            run_command([*self.command(), input_filepath, output_filepath, *layer], timeout=timeout, verbose=verbose)
        except CalledProcessError as error:
            if error.returncode == EXIT_UNSUPPORTED:
                raise NotSupportedError(f"{self.name} does not support the stream") from None
            raise
        return str(file_checksum(output_filepath))


@register_decoder
class OwnDecoder(CommandDecoder):
    """The decoder that GSVC_DECODER names."""

    name = "GSVC"
    description = "GSVC decoder of the variable GSVC_DECODER"

    def command(self) -> List[str]:  # noqa: UP006
        """The words of the variable."""
        return shlex.split(os.environ.get("GSVC_DECODER", ""))


@register_decoder
class SpecDecoder(CommandDecoder):
    """The decoder inside spec.md."""

    name = "GSVC-spec"
    description = "GSVC decoder inside spec.md, from the package gsvc_conformance"
    is_reference = True

    def command(self) -> List[str]:  # noqa: UP006
        """The module, where it is installed."""
        installed = importlib.util.find_spec("gsvc_conformance") is not None
        return [sys.executable, "-m", "gsvc_conformance.fluster"] if installed else []
