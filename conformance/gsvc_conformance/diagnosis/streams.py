"""Refusals: where in a stream an implementation stopped, by the name of the syntax element."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final

from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.expectations import Refusal
from gsvc_conformance.vector import Vector

REFUSED_LEGAL: Final = "a legal stream refused"

DESYNCS: Final = ("R-7-1", "R-6.2-3", "R-6.6-5", "R-15.6-5")
"""Rules that a decoder finds broken in a legal stream once it has read anything wrongly, whatever that was."""

MIN_KINDS: Final = 2
"""Kinds of errors that must be reported as another one."""


def refusal_sentence(failure: Failure) -> str:
    """The rule and the element of a wrong refusal, in words; '' where refusals are right or say too little."""
    for name, expectation in failure.vector.expected.items():
        given = failure.outputs.get(name)
        if not isinstance(expectation, Refusal) or not isinstance(given, str) or expectation.judge(given).passed:
            continue
        if not given:
            return f"a check that is not made ({' '.join(expectation.value.split()[:2])})"
        words = given.split()
        rule = f" by {words[1]}" if len(words) > 1 else ""
        at = element_at(failure.vector.inputs["stream"], int(words[2])) if len(words) > 2 and words[2].isdigit() else ""
        wrong = REFUSED_LEGAL if not expectation.value else "a refusal of another kind or too early"
        return f"{wrong}{rule}{f' at {at}' if at else ''}"
    return ""


def kind_sentence(failures: Sequence[Failure], passed: Iterable[Vector]) -> str:
    """The kind that every error is reported as, whatever it is, in words.

    It is '' if there is none, there are too few errors, or some are not reported at all.
    """
    pairs = [(expectation.value.split()[0], given.partition(" ")[0])
             for vector, outputs, _ in failures for name, expectation in vector.expected.items()
             if isinstance(expectation, Refusal) and expectation.value
             and isinstance(given := outputs.get(name), str)]  # fmt: skip
    reported = {kind for _, kind in pairs}
    others = {expectation.value.split()[0] for vector in passed for expectation in vector.expected.values()
              if isinstance(expectation, Refusal) and expectation.value}  # fmt: skip
    if (
        any(map(is_desync, failures))
        or len(reported) != 1
        or "" in reported
        or len({right for right, _ in pairs}) < MIN_KINDS
        or not others <= reported
    ):
        return ""
    return f"every error reported as of the kind {reported.pop()}, whatever it is"


def is_desync(failure: Failure) -> bool:
    """Whether a legal stream was refused as any wrong decoding before makes it look."""
    given = [
        failure.outputs.get(name) for name, expectation in failure.vector.expected.items()
        if isinstance(expectation, Refusal) and not expectation.value
    ]  # fmt: skip
    words = [text.split() for text in given if isinstance(text, str) and text]
    return any(len(one) < 2 or one[1] in DESYNCS for one in words)


@lru_cache(maxsize=256)
def element_at(stream: bytes, bit: int) -> str:
    """The syntax element of a stream that a bit belongs to, without its frame and index; '' if it is not reached.

    gsvc_ref finds it; where that is not installed, it is ''.
    """
    try:
        from gsvc_tools.listing import place_of
    except ModuleNotFoundError:
        return ""
    entry = place_of(stream, bit).entry
    if entry is None:
        return ""
    return f"{entry.name} of {entry.of}" if entry.of else entry.name


def elements_named(vector: Vector, *texts: object) -> str:
    """The elements at the bits of refusals, in brackets: `` (bit 4255: frequency[3] of color_index 1, frame 0)``.

    gsvc_ref finds them; where that is not installed, nothing is said.
    """
    try:
        from gsvc_tools.listing import name_at
    except ModuleNotFoundError:
        return ""
    bits = dict.fromkeys(text.split()[2] for text in texts if isinstance(text, str) and len(text.split()) == 3)
    stream = vector.inputs.get("stream")
    found = [(bit, name_at(stream, int(bit))) for bit in bits if bit.isdecimal() and isinstance(stream, bytes)]
    named = "; ".join(f"bit {bit}: {name}" for bit, name in found if name)
    return f" ({named})" if named else ""
