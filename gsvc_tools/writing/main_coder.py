"""The coding of given splats in profile `main`: which frame is of which type, and with which step D.

With a PSNR to hold, each frame has the coarsest step that is found to reach it; it is measured, frame by frame, against
the picture of the splats given. A frame that can be predicted becomes an I-frame where that takes fewer bits.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Self

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import log2, power
from gsvc_base.splats import Splats
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage
from gsvc_ref.encoder.held_quality import search_quantizer
from gsvc_ref.encoder.main.codes import INTRA_LIMITS, limits_of
from gsvc_ref.encoder.main.densities import choose_densities
from gsvc_ref.encoder.main.differences import anchors_of
from gsvc_ref.encoder.main.frame import LOSSLESS_PSNR, MainFrameEncoder
from gsvc_ref.encoder.main.intra import coded_order
from gsvc_ref.encoder.main.target import SQUARE_OF_8_BITS, Target
from gsvc_ref.encoder.settings import MainSettings
from gsvc_ref.encoder.stages import StageSeconds
from gsvc_ref.main.codes import SIDES, IntraCodes, MainCodes, modes_of
from gsvc_ref.main.densities import LARGEST_MAGNITUDE
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.motion import field_motion
from gsvc_ref.main.state import N_MOST
from gsvc_ref.main.tables import QUANTIZERS, step_of
from gsvc_ref.metrics import psnr
from gsvc_ref.paper import FrameType
from gsvc_tools.writing.given_splats import GivenSplats, SplatsError, check_level
from gsvc_tools.writing.main_codes import Codable, Refit, codable, motion_fields, nearest_differences, rounded

TRIES: Final = 12
"""The most steps that are tried for a frame."""

ROUNDING_ERROR: Final = 0.5
"""Squared error of a splat in D^2 from which the first step follows."""

BIT: Final = 0.24
"""The squared error in D^2 that a bit is worth where motion fields are compared."""

CHEAP: Final = 0.6
"""A P-frame with fewer bits than this share of the last I-frame's is not compared with an I-frame."""

DB_PER_DOUBLING: Final = 3.4
"""PSNR gained by twice the bits, for frames of different quality."""


@dataclass(frozen=True)
class _Coded:
    """A frame in codes, with what a decoder makes of it."""

    codes: MainCodes
    state: MainState
    ids: I8
    """The id of each decoded splat, (N,) i8."""
    psnr: float
    """In dB, against the picture of the splats given."""
    bits: int
    """Of its body."""


class MainSplatCoder:
    """Codes frames of splats in order, each against the reconstruction of the one before (closed loop)."""

    def __init__(
        self, settings: MainSettings, width: int, height: int, bit_depth: int, level: int, refit: Refit
    ) -> None:
        self.settings, self.level, self.refit = settings, level, refit
        self.encoder = MainFrameEncoder(settings, width, height, bit_depth)
        self.state = self.encoder.state  # the decoder's, after the frames so far
        self.ids = np.empty(0, np.int64)  # of the decoded splats
        self.given: GivenSplats | None = None  # the splats of the frame before as they were given
        # What splats that were refitted in the last I-frame have beside those that were given then, by id: (M,), (M, 8)
        self.refits = np.empty(0, np.int64), np.empty((0, 8))
        self.left_out = 0  # splats so far that were not coded, since they cannot be seen
        self.quantizer: int | None = None  # of the frame before, if that has one
        self.intra_bits, self.psnr = 0, math.inf  # of the last I-frame, and of the frame before

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile."""
        return self.encoder.elements()

    def for_group(self) -> Self:
        """The same coder, since its I-frames forget what was before them."""
        return self

    def encode(self, frame: GivenSplats, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Code a frame as an I-frame or, for type ``P``, in the way that is best; the next one follows on it."""
        progress("quantize", 0, 0, math.inf)
        seconds = StageSeconds()
        if frame_type == "P" and frame.equals(self.given):  # nothing is rendered: a few bytes may hold a million such
            return EncodedFrame(
                MainCodes.repeated_frame(), self.state, self.psnr, 0, seconds, reason="equal to the frame before"
            )
        check_level(frame.parameters, number, self.state.width, self.state.height, self.level)
        with seconds.timed("start"):
            work = _Frame(self, frame, number)
        with seconds.timed("quantize"):
            coded, reason = work.best(frame_type)
        work.check(coded)
        if coded.codes.type == "I":
            self.intra_bits = coded.bits
            self.refits = work.refits(coded) if self.refit != "none" else self.refits
        if coded.codes.type != "R":
            self.quantizer = coded.codes.quantizer
        self.left_out += len(frame.ids) - len(coded.ids)
        self.state, self.ids, self.given = coded.state, coded.ids, frame
        self.psnr = math.inf if coded.psnr == LOSSLESS_PSNR else coded.psnr
        return EncodedFrame(coded.codes, coded.state, self.psnr, 0, seconds, reason=reason)


class _Frame:
    """The work on one frame: what its steps share."""

    def __init__(self, coder: MainSplatCoder, frame: GivenSplats, number: int) -> None:
        self.coder, self.frame, self.number, self.settings = coder, frame, number, coder.settings
        self.before, encoder = coder.state, coder.encoder
        self.width, self.height, self.bit_depth = self.before.width, self.before.height, encoder.bit_depth
        splats = Splats.from_array(frame.parameters)
        self.shown = encoder.renderer.frame(splats, self.bit_depth)  # (H, W, 3) u1 or u2
        picture: F4 = encoder.renderer.picture(splats)
        self.target = Target(picture, **self.settings.computing)
        self.codable = _checked(codable(frame.parameters, self.width, self.height), number)
        # (n,): where each splat that stays stands in the state before, and in this frame
        self.old, self.rows = _same(coder.ids, frame.ids, self.codable)
        self.wanted_z = self.codable.anywhere[self.rows]  # (n, 8), of the splats that stay
        self.known_refits = np.zeros(self.wanted_z.shape)  # (n, 8)
        ids, refits = coder.refits
        if len(ids):
            place = np.minimum(np.searchsorted(ids, frame.ids[self.rows]), len(ids) - 1)
            is_known = ids[place] == frame.ids[self.rows]
            self.known_refits[is_known] = refits[place[is_known]]
        self.fields: dict[int, I8] = {}

    def best(self, frame_type: FrameType) -> tuple[_Coded, str | None]:
        """The frame in codes, and the reason for its type where it was chosen here."""
        if frame_type == "I":
            return self._searched(self._intra), None
        most = LEVELS[self.coder.level].splats
        news = int(self.codable.is_visible.sum()) - len(self.rows)
        if not len(self.rows) or len(self.before.values) + news > most:
            why = "no splat of the frame before stays" if not len(self.rows) else "no room for more splats in the level"
            return self._searched(self._intra), why
        self.fields = motion_fields(
            self.before.splats.to_array()[self.old], self.wanted_z[:, :2], SIDES[1:], self.width, self.height,
        )  # fmt: skip
        inter = self._searched(self._inter)
        if np.array_equal(inter.state.values, self.before.values):
            still = replace(inter, codes=MainCodes.repeated_frame(), state=self.before, ids=self.coder.ids, bits=0)
            return still, "nothing to see of what changed"
        reaches = self.settings.psnr is None or inter.psnr >= self.settings.psnr
        if reaches and (self.settings.key_frames != "auto" or inter.bits < CHEAP * self.coder.intra_bits):
            return inter, None
        intra = self._searched(self._intra)
        if reaches and self._score(inter) >= self._score(intra):
            return inter, "better than an I-frame"
        return intra, "better than a P-frame"

    def refits(self, coded: _Coded) -> tuple[I8, F8]:
        """What decoded splats have beside those given, in coordinates (M, 8), with their ids (M,) in rising order."""
        order, given = np.argsort(coded.ids), np.argsort(self.frame.ids)
        rows = given[np.searchsorted(self.frame.ids, coded.ids[order], sorter=given)]
        values, none = coded.state.values[order], np.zeros((len(order), 2), np.int64)
        decoded = anchors_of(values, none, step_of(coded.codes.quantizer), self.width * self.height).z
        return coded.ids[order], decoded - self.codable.z[rows]

    def check(self, coded: _Coded) -> None:
        """Refuse a frame that misses the PSNR that is to be held."""
        goal = self.settings.psnr
        if goal is not None and coded.psnr < goal:
            raise SplatsError(
                self.number,
                f"profile main comes to {coded.psnr:.2f} dB of the picture of these splats, and {goal:g} dB are asked "
                "for: ask for less, or write profile 'paper', which holds splats of any size and place",
            )

    def _score(self, coded: _Coded) -> float:
        """PSNR, as far as it is asked for, less what as many bits could have bought otherwise."""
        reached = min(coded.psnr, self.settings.psnr or math.inf)
        return reached - DB_PER_DOUBLING * float(log2(max(coded.bits, 1)))

    def _searched(self, make: Callable[[int], _Coded]) -> _Coded:
        """The frame with the step of the settings, or with the coarsest that reaches their PSNR."""
        settings, finest = self.settings, _finest(self.codable)
        if settings.quality is not None:
            return make(max(QUANTIZERS - 1 - settings.quality, finest))
        assert settings.psnr is not None
        first = self.coder.quantizer
        if first is None:
            error = 3 * self.width * self.height * SQUARE_OF_8_BITS * float(power(10.0, -settings.psnr / 10))
            D = math.sqrt(error / (ROUNDING_ERROR * max(len(self.frame.ids), 1)))
            first = min(range(QUANTIZERS), key=lambda quantizer: abs(step_of(quantizer) - 16 * D))
        found = search_quantizer(lambda quantizer: make(max(quantizer, finest)), first, settings.psnr, TRIES)
        return found if found.psnr >= settings.psnr else max(found, make(finest), key=lambda one: one.psnr)

    def _intra(self, quantizer: int) -> _Coded:
        """The codes of an I-frame."""
        rows = np.flatnonzero(self.codable.is_visible)
        codes = rounded(self.target, self.codable.z[rows], step_of(quantizer), self.coder.refit, self._rng())
        order = coded_order(codes, self.width, self.height)
        new = codes.take(order)
        made = MainCodes(quantizer, type="I", densities=self._densities(new, quantizer), new=new)
        return self._decoded(made, self.frame.ids[rows[order]])

    def _inter(self, quantizer: int) -> _Coded:
        """The codes of a P-frame, with the motion field that makes it cheapest."""
        make = partial(self._with_field, quantizer, self._new(quantizer))
        coded, least = make(0, np.zeros((0, 0, 2), np.int64))
        for cell, vectors in self.fields.items():
            other, cost = make(cell, vectors)
            if cost < least:
                coded, least = other, cost
        return replace(coded, psnr=self._psnr(coded.state))

    def _new(self, quantizer: int) -> tuple[IntraCodes, I8]:
        """The codes of splats that the state before has not, and their ids, in the order of cells."""
        is_new = self.codable.is_visible.copy()
        is_new[self.rows] = False
        rows, kept = np.flatnonzero(is_new), self.before.densities
        limits = INTRA_LIMITS if kept is None else limits_of(kept)
        codes = rounded(self.target, self.codable.z[rows], step_of(quantizer), "none", self._rng(), limits)
        order = coded_order(codes, self.width, self.height)
        return codes.take(order), self.frame.ids[rows[order]]

    def _with_field(self, quantizer: int, new: tuple[IntraCodes, I8], cell: int, vectors: I8) -> tuple[_Coded, float]:
        """The codes of a P-frame with a field, and their bits with the error that they leave, in bits."""
        values, step, (codes, new_ids) = self.before.values, step_of(quantizer), new
        motion = field_motion(values, vectors, cell)
        anchors = anchors_of(values[self.old], motion[self.old], step, self.width * self.height)
        found = nearest_differences(anchors, self.wanted_z, self.known_refits)
        q, removed = np.zeros((len(values), 8), np.int64), np.ones(len(values), np.bool_)
        q[self.old], removed[self.old] = found.q, False
        densities = self._densities(codes, quantizer) if self.before.densities is None else None
        made = MainCodes(
            quantizer, type="P", motion_cell=SIDES.index(cell), new=codes, densities=densities, vectors=vectors,
            modes=modes_of(q, removed), differences=q,
        )  # fmt: skip
        coded = self._decoded(made, np.concatenate([self.coder.ids[~removed], new_ids]), is_measured=False)
        return coded, coded.bits + found.error / BIT

    def _densities(self, codes: IntraCodes, quantizer: int) -> Any:
        """The densities of new splats, if there are any."""
        return choose_densities(codes, step_of(quantizer), self.width, self.height) if len(codes) else None

    def _decoded(self, codes: MainCodes, ids: I8, *, is_measured: bool = True) -> _Coded:
        """Codes with what a decoder makes of them."""
        codes, state, bits = self.coder.encoder.as_written(codes, self.before)
        return _Coded(codes, state, ids, self._psnr(state) if is_measured else 0.0, bits)

    def _psnr(self, state: MainState) -> float:
        """PSNR in dB of a decoded frame against that of the splats given, at most LOSSLESS_PSNR."""
        shown = self.coder.encoder.renderer.frame(state.splats, self.bit_depth)
        return min(psnr(self.shown, shown, (1 << self.bit_depth) - 1), LOSSLESS_PSNR)

    def _rng(self) -> np.random.Generator:
        """Randomness of the frame: each try begins with the same draws."""
        return np.random.default_rng([self.settings.seed, self.number])


def _checked(splats: Codable, number: int) -> Codable:
    """Refuse colours that a state cannot hold."""
    wrong = (np.abs(splats.z[:, 5:]) > N_MOST / 16).any(axis=1) & splats.is_visible
    if wrong.any():
        raise SplatsError(
            number,
            "its colour is too large for its size: 255 sqrt(pi l11 l22) times R, G and B must stay below 2^23 in "
            "profile main; write profile 'paper', or give smaller colours",
            int(np.flatnonzero(wrong)[0]),
        )
    return splats


def _finest(splats: Codable) -> int:
    """The finest quantizer by which every colour has a code."""
    largest = 16 * np.abs(splats.z[splats.is_visible, 5:]).max(initial=0.0)
    return next(quantizer for quantizer in range(QUANTIZERS) if step_of(quantizer) * LARGEST_MAGNITUDE > largest)


def _same(decoded: I8, given: I8, splats: Codable) -> tuple[I8, I8]:
    """The places of splats that stay and can be seen, among the ids decoded (M,) and those given (N,), (n,) each."""
    if not len(given):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    order = np.argsort(given)
    rows = order[np.minimum(np.searchsorted(given, decoded, sorter=order), len(order) - 1)]
    stays = (given[rows] == decoded) & splats.is_visible[rows]
    return np.flatnonzero(stays), rows[stays]
