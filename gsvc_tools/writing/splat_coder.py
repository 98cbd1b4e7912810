"""The coding of splats in profile `paper` as they are given: nothing is fitted, and quantisers learn from them alone.

An I-frame quantises the splats. A P-frame quantises the differences of those that the frame before has, from the
*decoded* frame before, and the splats that it has not. Steps of differences follow the error that the last I-frame was
left with, and what changes the picture less than that error is left as it is.
"""

from typing import Any, Final, NamedTuple, Self

import numpy as np

from gsvc_base.arrays import F4, I8
from gsvc_base.portable import log2
from gsvc_base.splats import Splats
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.frames import FrameElements
from gsvc_ref.bitstream.frames import frame as write_frame
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.encoder.stages import StageSeconds
from gsvc_ref.metrics import psnr
from gsvc_ref.paper import FrameCodes, FrameType, State, reconstruct
from gsvc_ref.rendering import Objective, Renderer
from gsvc_ref.training import KEPT_WEIGHT, NEW, FrameQuantizer, Population, psnr_of_loss
from gsvc_tools.writing.given_splats import GivenSplats, check_level

DB_PER_DOUBLING: Final = 3.4
"""PSNR gained by twice the splats, and so by about twice the bits, as measured on photographs."""

CODEBOOKS: Final = ((0, 4, 8), (32, 3, 32), (128, 8, 16), (2048, 6, 32))
"""From how many splats on colours have so many stages of so many codewords. Of the choices that were tried on fitted
pictures these take the fewest bits within 0.6 dB of 6 stages of 32, whose codewords alone take 9,216 bits a frame: 240
bits a splat, not 726, for 16 splats, 171, not 259, for 64, and 134, not 147, for 200."""

MAX_PSNR: Final = 59.0
"""PSNR in dB from which on a frame counts as exact: rounding to 8 bits leaves 58.9 dB."""


class _Coded(NamedTuple):
    """A frame in codes."""

    codes: FrameCodes
    state: State
    """The decoder's state after it."""
    ids: I8
    """The id of each decoded splat, (N,) i8."""


class SplatCoder:
    """Codes frames of splats in order, each against the reconstruction of the one before (closed loop)."""

    def __init__(
        self,
        settings: PaperSettings,
        width: int,
        height: int,
        bit_depth: int,
        level: int,
        *,
        sizes_codebooks: bool = False,  # as CODEBOOKS has them for the splats of the first frame
    ) -> None:
        self._sizes_codebooks = sizes_codebooks
        self.settings, self.level, self.bit_depth = settings, level, bit_depth
        self.width, self.height = width, height
        self.state = State.initial(width, height)  # the decoder's, after the frames so far
        self._ids = np.empty(0, np.int64)  # of the decoded splats
        self._given: GivenSplats | None = None  # the splats of the frame before as they were given
        self._accepted = 0.0  # the loss of the last I-frame against the splats given
        self._reached = np.inf  # the PSNR of the frame before
        self._renderer = Renderer(width, height, precision=settings.precision, threads=settings.threads)

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile."""
        return self.settings.quantizer_elements()

    def for_group(self) -> Self:
        """The same coder, since its I-frames forget what was before them."""
        return self

    def encode(self, frame: GivenSplats, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Code a frame as an I-frame or, for type ``P``, in the way that is best; the next one follows on it."""
        if self._sizes_codebooks:
            _, stages, codewords = max(row for row in CODEBOOKS if row[0] <= len(frame.ids))
            self.settings = self.settings.with_(color_stages=stages, color_codewords=codewords)
            self._sizes_codebooks = False
        progress("quantize", 0, 0, np.inf)
        seconds = StageSeconds()
        if frame_type == "P" and frame.equals(self._given):  # nothing is rendered: a few bytes may hold a million such
            return EncodedFrame(
                FrameCodes.repeated_frame(), self.state, self._reached, 0, seconds, reason="equal to the frame before"
            )
        check_level(frame.parameters, number, self.width, self.height, self.level)
        with seconds.timed("start"):
            given = Splats.from_array(frame.parameters)
            objective = Objective(self._renderer.picture(given), **self.settings.computing)
        with seconds.timed("quantize"):
            coded, reason = self._coded(frame, frame_type, number, objective)
        with seconds.timed("check"):
            wanted, shown = (self._renderer.frame(splats, self.bit_depth) for splats in (given, coded.state.splats))
            self._reached = psnr(wanted, shown, (1 << self.bit_depth) - 1)
        if coded.codes.type == "I":
            self._accepted = objective.loss(coded.state.splats.to_array())
        self.state, self._ids, self._given = coded.state, coded.ids, frame
        return EncodedFrame(coded.codes, coded.state, self._reached, 0, seconds, reason=reason)

    def _coded(
        self, frame: GivenSplats, frame_type: FrameType, number: int, objective: Objective
    ) -> tuple[_Coded, str | None]:
        """The frame in codes, and the reason for its type where it was chosen here."""
        if frame_type == "I":
            return self._intra(frame, number, objective), None
        if not np.isin(self._ids, frame.ids).any():
            return self._intra(frame, number, objective), "no splat of the frame before stays"
        inter = self._inter(frame, number, objective)
        if not _changes(inter.codes):
            return _Coded(FrameCodes.repeated_frame(), self.state, self._ids), "nothing to see of what changed"
        if self.settings.key_frames != "auto":
            return inter, None
        intra = self._intra(frame, number, objective)
        if self._score(inter, number, objective) >= self._score(intra, number, objective):
            return inter, "better than an I-frame"
        return intra, "better than a P-frame"

    def _intra(self, frame: GivenSplats, number: int, objective: Objective) -> _Coded:
        """The codes of an I-frame."""
        origins = np.full(len(frame.ids), NEW, np.int64)
        return self._quantized(frame.parameters, origins, frame.ids, self.state.forget(), number, objective)

    def _inter(self, frame: GivenSplats, number: int, objective: Objective) -> _Coded:
        """The codes of a P-frame: the splats that the frame before has, in its order, then the others."""
        order = np.argsort(frame.ids)
        place = np.searchsorted(frame.ids, self._ids, sorter=order)
        rows = order[np.minimum(place, len(order) - 1)]  # the row that may continue each decoded splat
        origins = np.flatnonzero(frame.ids[rows] == self._ids)
        is_new = np.ones(len(frame.ids), np.bool_)
        is_new[rows[origins]] = False
        rows = np.concatenate([rows[origins], np.flatnonzero(is_new)])
        origins = np.concatenate([origins, np.full(int(is_new.sum()), NEW)])
        return self._quantized(frame.parameters[rows], origins, frame.ids[rows], self.state, number, objective)

    def _quantized(
        self, parameters: F4, origins: I8, ids: I8, before: State, number: int, objective: Objective
    ) -> _Coded:
        """Codes of splats, survivors first, and what a decoder makes of them."""
        intra, inter = self.settings.intra, self.settings.inter
        population = Population(Splats.from_array(parameters), KEPT_WEIGHT, origins)
        quantizer = FrameQuantizer(
            population, objective, intra.quantizer, inter.quantizer, before,
            np.random.default_rng([self.settings.seed, number]), self._accepted,
        )  # fmt: skip
        codes = quantizer.codes(parameters)
        return _Coded(codes, reconstruct(codes, before), ids)

    def _score(self, coded: _Coded, number: int, objective: Objective) -> float:
        """PSNR less what as many bits could have bought otherwise: DB_PER_DOUBLING for each doubling."""
        reached = min(psnr_of_loss(objective.loss(coded.state.splats.to_array())), MAX_PSNR)
        return reached - DB_PER_DOUBLING * float(log2(self._bytes(coded, number)))

    def _bytes(self, coded: _Coded, number: int) -> int:
        """The size in bytes of a frame's payload."""
        header = SequenceHeader(
            level=self.level, width=self.width, height=self.height, **self.settings.quantizer_elements()
        )
        s = Writer()
        write_frame(s, header, self.state, coded.codes.type, number, FrameElements(number, None, coded.codes))
        return len(s.getvalue())


def _changes(codes: FrameCodes) -> bool:
    """Whether a P-frame changes anything of the frame before."""
    inter = codes.inter
    stays = codes.survivors is not None and codes.survivors.all() and codes.intra_count == 0
    return not stays or (inter is not None and inter.count is not None)
