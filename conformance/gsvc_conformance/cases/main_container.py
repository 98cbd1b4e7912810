"""Legal containers of profile `main`: what a decoder must skip, ignore or do without, as in `container`."""

from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import on, operated, result
from gsvc_conformance.cases.container import DESCRIPTIVE, FAULTY_TIMES, MINORS, TIMES, UUID
from gsvc_conformance.cases.faults import MAIN
from gsvc_conformance.cases.main_streams import READ
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.testing import Lie, join_chunks, split_chunks


def _with_times(*payloads: bytes) -> bytes:
    """The overview with chunks `t` before its first frames, one before each."""
    head, *frames = split_chunks(MAIN.overview(index=False))
    between = [part for payload, frame in zip(payloads, frames, strict=False) for part in ((b"t", payload), frame)]
    return join_chunks([head, *between, *frames[len(payloads) :]], prefix=MAIN.overview()[:PREFIX_SIZE])


@on("core", *READ, flags=["unknown"], rules=["R-6.1-2", "R-6.1-6", "R-6.1-7"], each=MINORS,
    said={"nothing_new": "nothing", "many": "sixty bytes"})  # fmt: skip
def main_later_minor_version(value: tuple[int, bytes]) -> Inputs:
    """A later minor version, which adds {key} to the header of profile `main`: what follows `main_tools` is ignored."""
    minor, extra = value
    expected = yield {"stream": MAIN.overview(Lie("version_minor", minor), Lie("main_tools", b"\0" + extra))}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["unknown", "limit"], rules=["R-5-3", "R-6.1-6"])
def main_header_of_1024_bytes() -> Inputs:
    """The longest header that any version of profile `main` may have."""
    size = len(split_chunks(MAIN.overview())[0][1])
    lies = Lie("version_minor", 9), Lie("main_tools", bytes(1 + 1024 - size))
    expected = yield {"stream": MAIN.overview(*lies)}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["unknown"], rules=["R-6.3-3"], each=DESCRIPTIVE)
def main_descriptive(value: dict[str, int]) -> Inputs:
    """An element that only describes the source is beyond its range, and nothing is refused: {key}."""
    expected = yield {"stream": MAIN.overview(*(Lie(element, said) for element, said in value.items()))}
    assert result(expected, "counts").tolist() == [1] * 3
    if "header" in expected:
        assert set(value.values()) <= set(result(expected, "header").tolist())


@on("core", *READ, rules=["R-6.3-2"])
def main_frame_count_unknown() -> Inputs:
    """The header's frame count is unknown."""
    expected = yield {"stream": MAIN.overview(Lie("frame_count", 0))}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["unknown"], rules=["R-6.2-1", "R-6.2-5"])
def main_ancillary_chunks() -> Inputs:
    """Chunks of unknown lower-case types may be anywhere: a decoder skips them."""
    like_a_frame = b"p", b"\7\0" + UUID[2:]
    extra = [(b"a", b""), (b"z", bytes(range(60))), (b"i", b"\0"), like_a_frame, (b"h", b"?"), (b"e", bytes(8))]
    expected = yield {"stream": MAIN.edited(lambda c: [c[0], *extra, *c[1:3], extra[1], *c[3:-1], *extra, c[-1]])}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["unknown"], rules=["R-6.2-5", "R-6.2-6", "R-6.2-8"])
def main_every_ancillary_type() -> Inputs:
    """All lower-case letters but n and x; the private ones begin with a UUID."""
    letters = [bytes([c]) for c in range(ord("a"), ord("z") + 1) if c not in b"nx"]
    extra = [(letter, UUID + letter if letter in b"pqrs" else letter) for letter in letters]
    expected = yield {"stream": MAIN.edited(lambda c: [*c[:2], *extra, *c[2:]])}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["index", "unknown"], rules=["R-6.7-2", "R-6.8-2"])
def main_index_that_is_not_last() -> Inputs:
    """An index in the middle is read and not used; `index_length` is 0, since none stands before the end chunk."""
    middle = [(b"x", encode_uv(1) + encode_uv(0) + encode_uv(PREFIX_SIZE)), (b"a", b"")]
    expected = yield {"stream": MAIN.edited(lambda c: [*c[:3], *middle, *c[3:-1], *middle, c[-1]])}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["index"], rules=["R-6.7-2", "R-6.8-2"])
def main_index_behind_an_index() -> Inputs:
    """Two indices before the end chunk: `index_length` is that of the one directly before it."""
    data = operated(lambda c: [*c[:-2], (b"x", b"\0"), *c[-2:]], MAIN.overview())
    expected = yield {"stream": data}
    assert result(expected, "counts").tolist() == [1] * 3


@on("core", *READ, flags=["unknown"], rules=["R-6.11-1", "R-6.11-2"], each=TIMES)
def main_time_stamps(value: list[tuple[int, ...]]) -> Inputs:
    """Time stamps {key}, which change no frame."""
    expected = yield {"stream": _with_times(*(b"".join(map(encode_uv, numbers)) for numbers in value))}
    assert result(expected, "counts").tolist() == [1] * 3


@case("core", "reconstruct_stream", flags=["unknown"], rules=["R-6.11-1", "R-6.11-2", "R-6.11-3"], each=FAULTY_TIMES)
def main_faulty_time_stamps(value: tuple[bytes, ...]) -> Inputs:
    """Time stamps {key}: they are ignored, and refuse no stream."""
    expected = yield {"stream": _with_times(*value)}
    assert result(expected, "counts").tolist() == [1] * 3
