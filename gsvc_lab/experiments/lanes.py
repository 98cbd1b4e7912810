"""Lanes of profile `main`: the bits that they cost, and the rounds in which a frame can be parsed with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from gsvc_base.arrays import F8, I8
from gsvc_lab.clips import Clip, packaged_clip, scene_clip
from gsvc_lab.experiments.encodes import encoded, excerpt
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.material import given_clips
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.header import MAX_LANE_EXPONENT
from gsvc_ref.encoder.settings.common import MAX_SPLATS
from gsvc_ref.encoder.settings.main import BY_SIZE, MainSettings
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import frame_body, symbols_of
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.stream import Stream

WAYS: Final[Mapping[str, int | str]] = {
    "1": 1, "32": 32, "64": 64, "by size": BY_SIZE, "by size, 1 %": f"{BY_SIZE}:1%",
    "by size, 2 %": f"{BY_SIZE}:2%",
}  # fmt: skip
"""The `lane_count` of the encoder, by its name in tables; the first is one lane."""

DEFAULT: Final = [*WAYS.values()].index(BY_SIZE)


@dataclass(frozen=True)
class Goal:
    """What lanes by size have to reach with frames of a size."""

    splats: int
    frames: int  # that are encoded, in the small version
    most_more: float  # must: bits of the bodies of frames, in % more than with one lane
    most_rounds: int  # must, in the mean over frames
    aimed_rounds: int


SMALL: Final = Goal(2_000, 8, 0.6, 500, 250)
LARGE: Final = Goal(10_000, 3, 0.7, 550, 300)


def goal_of(clip: Clip) -> Goal:
    """What lanes have to reach with frames of the size of a clip."""
    return LARGE if clip.format.width * clip.format.height >= 1 << 20 else SMALL


@dataclass(frozen=True)
class Measured:
    """The I- and P-frames of a clip, each in lanes of every way."""

    clip: str
    goal: Goal
    types: str
    frames: I8  # (F, ways, 3), of each the lanes, the bits of its body and the rounds

    def means(self, types: str = "IP") -> F8:
        """The means over frames of some types, (ways, 3); 0 where there is none."""
        kept = self.frames[[kind in types for kind in self.types]]
        return np.asarray(kept.sum(axis=0) / max(len(kept), 1), np.float64)

    @property
    def more(self) -> F8:
        """The bits of bodies, in % more than with one lane, (ways,)."""
        bits = self.means()[:, 1]
        return np.asarray(100 * (bits / bits[0] - 1), np.float64)


def in_lanes(before: MainState, codes: MainCodes, left: list[int]) -> I8:
    """The lanes, the bits of its body and the rounds of an I- or P-frame in lanes of every way, (ways, 3).

    `left` are the bits for lanes that earlier frames left, by way; what this one leaves takes their place.
    """
    items = np.bincount(symbols_of(before, codes)[:, 2])  # of each pass

    def coded(exponent: int) -> tuple[int, int, int]:
        body, given = Writer(), replace(codes, lane_exponent=exponent)
        frame_body(body, codes.type, before, MAX_LANE_EXPONENT, MAX_SPLATS, given)
        return 1 << exponent, body.position, int((-(-items >> exponent)).sum())

    _, bits, _ = coded(0)
    found = []
    for number, count in enumerate(WAYS.values()):
        settings, saved = MainSettings.quick(lane_count=count), left[number] if codes.type == "P" else 0
        most = settings.max_lane_exponent(before.width, before.height)
        exponent = settings.lane_exponent(bits, int(items.sum()), saved, most)
        left[number] = settings.lane_bits_left(bits, saved, exponent)
        found.append(coded(exponent))
    return np.array(found)


def measure(clip: Clip, run: Run) -> Measured:
    """A clip encoded once, and its frames in lanes."""
    goal = goal_of(clip)
    settings = MainSettings.quick(splats=goal.splats, threads=run.threads)
    stream = encoded(clip, settings, run.say, f"{clip.name}, N {goal.splats:,}").stream
    before, types, frames, left = MainState.initial(clip.format.width, clip.format.height), "", [], [0] * len(WAYS)
    with Stream(stream) as opened:
        for frame in opened:
            assert isinstance(frame.codes, MainCodes)
            assert isinstance(frame.state, MainState)
            if frame.type != "R":
                types += frame.type
                frames.append(in_lanes(before, frame.codes, left))
            before = frame.state
    return Measured(clip.name, goal, types, np.stack(frames))


def verdict(all_of: Sequence[Measured]) -> Verdict:
    """The musts, by the default of the encoder."""
    sentences, holds = [], True
    for one in all_of:
        goal, more, rounds = one.goal, one.more[DEFAULT], one.means()[:, 2]
        holds = holds and more <= goal.most_more and rounds[DEFAULT] <= goal.most_rounds
        sentences.append(
            f"{one.clip} takes {more:+.2f} % bits (must: {goal.most_more:+} %) and {rounds[DEFAULT]:,.0f} rounds a "
            f"frame in place of {rounds[0]:,.0f} (must: {goal.most_rounds}; aim {goal.aimed_rounds})"
        )
    return Verdict("yes" if holds else "no", f"With lanes by size {'; '.join(sentences)}.")


def run(settings: Run) -> Result:
    """Encode each clip, and code its frames anew in lanes."""
    times = 4 if settings.full else 1
    named = given_clips(settings) or [
        packaged_clip("bikes").scaled(352, 288), scene_clip("talking-head", 352, 288, times * SMALL.frames),
        packaged_clip("bigbuckbunny").scaled(1920, 1080)
    ]  # fmt: skip
    clips = [excerpt(one, 0, times * goal_of(one).frames, one.format.width, one.format.height) for one in named]
    all_of = [measure(clip, settings) for clip in clips]
    rows, numbers = [], {}
    for one in all_of:
        for number, way in enumerate(WAYS):
            means = np.stack([one.means(types)[number] for types in ("I", "P", "IP")], axis=1)  # (3, 3)
            parts = [dict(zip(("I", "P", "all"), values, strict=True)) for values in means.tolist()]
            numbers[f"{one.clip}, {way}"] = dict(zip(("lanes", "bits", "rounds"), parts, strict=True))
            lanes, bits, rounds = ([f"{value:,.0f}" for value in values] for values in means)
            rows.append((one.clip, way, *lanes[:2], *bits, f"{one.more[number]:+.2f} %", *rounds))
    columns = ("clip", "lanes", "of I", "of P", "bits of a body, I", "P", "all", "than with 1", "rounds, I", "P", "all")
    setting = (
        f"On {'; '.join(f'{clip.about}, N {goal_of(clip).splats:,}' for clip in clips)}. Profile main, preset quick; "
        "means over frames that are not of type R. Each clip is encoded once, and the same codes are written with each "
        "number of lanes. In a round each lane decodes one symbol, and a pass begins when all before it are done."
    )
    table = Table("Bits and rounds of a frame", columns, tuple(rows))
    return Result(setting, numbers, (table,), verdict=verdict(all_of))


EXPERIMENT: Final = Experiment(
    "lanes",
    "Frames parsed in lanes",
    "It says nothing about decoding the symbols of a frame side by side.",
    run,
)
