"""Moving pictures for a web page or a chat (.gif, .webp), written through Pillow; they are lossy."""

from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image, features

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError, naming
from gsvc_base.files import PartialFile
from gsvc_ref.video.format import VideoFormat
from gsvc_ref.video.stream import NO_EXTRAS, Extras, VideoWriter

MAX_HELD: Final = 1 << 30
"""Maximum number of bytes of all pictures: Pillow writes the file at the end, and holds them until then."""

GIF_COLOURS: Final = 256
"""Colours of a picture in a GIF."""

MIN_DELAY: Final = {".gif": 20, ".webp": 1}
"""Least milliseconds of a picture. Browsers show a GIF whose delay is below 20 ms at 100 ms."""

UNIT: Final = {".gif": 10, ".webp": 1}
"""Milliseconds that delays are counted in."""

LONGEST_SIDES: Final = {".gif": 65535, ".webp": 16383}
"""Maximum number of pixels of a side."""


class AnimationWriter(VideoWriter):
    """A writer of an animated GIF or WebP of 8 bits, which repeats for ever.

    A GIF has at most 256 colours in each picture, chosen for it, and counts time in hundredths of a second, a WebP in
    milliseconds; delays are rounded such that errors do not add up. A UsageError says that Pillow was built without
    WebP, a side is too long, the pictures have more than MAX_HELD bytes, or, on `close`, that there is no frame.
    """

    carries_times = True

    def __init__(self, target: Path, video: VideoFormat, extras: Extras = NO_EXTRAS) -> None:
        super().__init__(video, extras)
        self._target, self._kind = target, target.suffix.lower()
        if self._kind == ".webp" and not features.check("webp"):
            raise UsageError("this Pillow cannot write WebP; write .gif or .mp4")
        most = LONGEST_SIDES[self._kind]
        if max(video.width, video.height) > most:
            raise UsageError(f"{self._kind} takes at most {most} pixels on a side; write .mp4 or PNG files")
        self._partial = PartialFile(target)
        self._pictures: list[Image.Image] = []
        self._delays: list[int] = []
        self._end = 0
        self.written_depth = 8
        limits = f"{GIF_COLOURS} colours a picture" if self._kind == ".gif" else "8 bits, quality 90"
        self.notes.append(f"{target.name} is a lossy copy ({limits}); y4m and PNG hold the frames exactly")
        if video.sample_aspect_ratio != 1:
            self.notes.append(f"{target.name} does not carry the pixel shape {video.sample_aspect_ratio}")

    def _write(self, frame: Frame) -> None:
        size = frame.shape[0] * frame.shape[1] * (1 if self._kind == ".gif" else 3)
        if (len(self._pictures) + 1) * size > MAX_HELD:
            raise UsageError(
                f"{self._target.name} would take more than {MAX_HELD >> 20} MiB of memory: decode fewer frames "
                f"(--frames), or write .mp4"
            )
        picture = Image.fromarray(np.rint(frame * (255 / self.format.peak)).astype(np.uint8))
        if self._kind == ".gif":
            picture = picture.quantize(GIF_COLOURS, Image.Quantize.MEDIANCUT)
        self._pictures.append(picture)
        self._delays.append(self._delay(self.span()[1]))

    def _delay(self, end: Fraction) -> int:
        """Milliseconds from the end of the picture before to that of this one, in the units of the format."""
        unit, least = UNIT[self._kind], MIN_DELAY[self._kind]
        ends = round(1000 * end / unit) * unit
        delay = max(ends - self._end, least)
        if delay != ends - self._end:
            sentence = f"{self._target.name} shows no picture for less than {least} ms, so it is slower"
            self.notes += [sentence] if sentence not in self.notes else []
        self._end += delay
        return delay

    def _finish(self) -> None:
        if not self._pictures:
            raise UsageError(f"there is no frame to write as {self._target}")
        options: dict[str, Any] = {"quality": 90, "method": 4} if self._kind == ".webp" else {"optimize": False}
        first, *others = self._pictures
        with naming(str(self._target)):
            first.save(
                self._partial.path, format=self._kind[1:], save_all=True, append_images=others, duration=self._delays,
                loop=0, **options,
            )  # fmt: skip
        self._partial.commit()
        self._pictures.clear()

    def _discard(self) -> None:
        self._pictures.clear()
        self._partial.discard()
