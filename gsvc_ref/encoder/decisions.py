"""What an encoder decided about each effect of a frame, why, and what it cost."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from gsvc_ref.encoder.effects import EFFECT_NAMES, EffectName, Effects
from gsvc_ref.reconstruction import FrameType


class Cause(NamedTuple):
    """A kind of reason.

    Attributes
    ----------
    text
        Its phrase, in which ``{n}`` stands for the number.
    scale
        The number is kept times this, as a whole number.
    is_rare
        Whether streams keep all of the number's digits; of others, which most frames have, one.
    """

    text: str
    scale: int = 1
    is_rare: bool = False


CAUSES: Final = {
    "asked": Cause("asked for"),
    "off": Cause("switched off"),
    "key": Cause("an I-frame begins from nothing"),
    "repeat": Cause("the frame before is repeated"),
    "first": Cause("the first frame"),
    "equal": Cause("equal to the frame before"),
    "differs": Cause("{n} % of the pixels differ from the frame before"),
    "same": Cause("fewer iterations: predicted with {n} times the error of the frame before", 100),
    "at rest": Cause("all splats rest, so the frame before is repeated"),
    "moving": Cause("something changed under every splat"),
    "rest": Cause("{n} % of the splats rest: nothing changed under them"),
    "quality": Cause("a quality to hold: every splat is optimised"),
    "still": Cause("nothing moves"),
    "no gain": Cause("moving splats along the flow would not bring the prediction closer"),
    "gain": Cause("moved splats bring the prediction {n} dB closer", 10),
    "new": Cause("{n} % of the picture is predicted worse than the frame before was left"),
    "nothing new": Cause("no part of the picture is predicted worse than the frame before was left"),
    "too little": Cause("{n} % of the picture is predicted worse, for which not even one splat is added"),
    "no room": Cause("no room for more splats without pruning"),
    "fits": Cause("the rate has room for all splats"),
    "exchanged": Cause("{n} splats make room for new ones"),
    "pruned": Cause("{n} splats removed during the fit", 1, True),
    "taken back": Cause("as many splats as were added: {n}", 1, True),
    "spare": Cause("{n} splats fewer hold the quality"),
    "nothing to spare": Cause("the quality has nothing to spare"),
    "every": Cause("key frames are not looked for"),
    "smooth": Cause("no cut: the picture changes by {n} % of its variance", 10),
    "cut": Cause("a cut: predicted with {n} times the loss of a fit from scratch", 10, True),
    "no cut": Cause("no cut: predicted with {n} times the loss of a fit from scratch", 10, True),
    "usual": Cause("no cut: the picture changes no more than around it"),
}  # fmt: skip
"""All causes. Streams name them by their place in this table, so it only ever grows at its end."""

CAUSE_NAMES: Final = tuple(CAUSES)

MAX_VALUE: Final = (1 << 16) - 2
"""The largest number stored with a cause."""


@dataclass(frozen=True)
class Decision:
    """One decision about one effect of one frame.

    Attributes
    ----------
    effect
        A field of `Effects`.
    done
        Whether its work was done; False if all or part of it was left out.
    cause
        Why: a name in `CAUSES`.
    value
        The number that it rests on, times the scale of the cause; None where there is none.
    iterations
        Optimisation steps that it took: for ``dks`` of pre-training, for ``frames`` of fitting and fine-tuning.
    saved
        Optimisation steps that `all` would have taken in addition, as far as they are known beforehand.
    seconds
        Time that it took; 0 when read from a stream, which does not tell.
    """

    effect: EffectName
    done: bool
    cause: str
    value: int | None = None
    iterations: int = 0
    saved: int = 0
    seconds: float = 0.0

    @property
    def stored(self) -> int | None:
        """The value as streams keep it."""
        if self.value is None or CAUSES[self.cause].is_rare:
            return self.value
        return min(int(float(f"{self.value:.0e}")), MAX_VALUE)

    @property
    def number(self) -> str:
        """The number that it rests on."""
        scale = CAUSES[self.cause].scale
        if self.value is None:
            return "?"
        return f"{self.value / scale:g}" if scale > 1 else f"{self.value:,}"

    @property
    def reason(self) -> str:
        """Why, as a phrase with its number."""
        return CAUSES[self.cause].text.format(n=self.number)


def decision(
    effect: EffectName, cause: str, number: float | None = None, *, done: bool, iterations: int = 0, saved: int = 0,
    seconds: float = 0.0,
) -> Decision:  # fmt: skip
    """A decision with its number as measured, which is kept as precisely as its cause tells it."""
    value = None if number is None else min(max(0, round(number * CAUSES[cause].scale)), MAX_VALUE)
    return Decision(effect, done, cause, value, iterations, saved, seconds)


def completed(made: Iterable[Decision], effects: Effects, frame_type: FrameType) -> tuple[Decision, ...]:
    """One decision about each effect, in their order: the last one made, or that there was nothing to decide."""
    last = {one.effect: one for one in made}
    for name in EFFECT_NAMES:
        if name in last:
            continue
        if effects.mode(name) == "off":
            cause = "off"
        elif frame_type == "R":
            cause = "repeat"
        else:
            cause = "fits" if name == "gsp" else "key"
        last[name] = decision(name, cause, done=False)
    return tuple(last[name] for name in EFFECT_NAMES)
