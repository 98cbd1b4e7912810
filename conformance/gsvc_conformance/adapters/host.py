"""The host's half of a decoder whose other half runs on an accelerator.

Parsing is sequential and full of decisions, so a GPU decoder does it on the CPU. Here the parser inside spec.md does,
and calls the back end for everything that is arithmetic on many elements.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np

from gsvc_conformance import spec

Operations = dict[str, Callable[..., dict[str, Any]]]

LaneDecoder = Callable[[int, Sequence[int], int, Sequence[int], Sequence[int]], tuple[Any, list[int], int]]
"""(count, frequencies, precision, states, words) to symbols u2 (count,), final states, and how many words it takes."""

MainReader = Callable[[dict[str, Any]], dict[str, Any]]
"""The names of the code of spec.md, which may be filled afterwards, to functions that take the place of its own:
`MainState`, `copied`, `carried`, `read_main_body`, `state_parameters` and `main_work`."""

STREAM_OPERATIONS: Final = (
    "reconstruct_stream",
    "decode_stream",
    "decode_stream_deterministic",
    "decode_layers",
    "seek",
)
"""The operations of spec.md that call the back end."""

PLANE_OPERATIONS: Final = ("read_stream", "decode_plane")
"""The further operations of spec.md that decode planes."""


def code_of_spec(functions: Mapping[str, Callable[..., Any]]) -> dict[str, Any]:
    """The names of the code of spec.md with functions in the place of its own, for decoders that call it themselves."""
    return spec.namespace(functions=functions)


def stream_operations(
    back_end: Mapping[str, Callable[..., Any]],
    decode_lanes: LaneDecoder | None = None,
    main_profile: "MainBackEnd | None" = None,
    main_reader: "MainReader | None" = None,
) -> Operations:
    """The operations of whole streams, by name, with functions of a back end in the place of spec.md's own.

    Parameters
    ----------
    back_end
        By the names of spec.md: ``reconstruct_intra`` and ``reconstruct_inter``, and for pictures ``render_frame``,
        ``render_sum_deterministic`` and ``to_frame_deterministic``; they take keyword or positional arguments in the
        order of spec.md and return dicts, as the operations of these names do.
    decode_lanes
        The function that decodes the symbols of coded planes (7-1); with it come the operations ``read_stream`` and
        ``decode_plane``. Where words are missing it may take any number for them.
    main_profile
        What decodes frames of profile `main`; with it come the operations ``read_main_stream`` and
        ``reconstruct_layers``. Without it the code of spec.md decodes them.
    main_reader
        In its place, what reads such a frame from its first element on.
    """
    names: dict[str, Any] = {}
    functions = dict(back_end)
    found: Sequence[str] = STREAM_OPERATIONS
    if main_profile is not None:
        functions |= main_functions(main_profile, names)
    if main_reader is not None:
        functions |= main_reader(names)
    if main_profile is not None or main_reader is not None:
        found = MAIN_OPERATIONS
    if decode_lanes is None:
        names.update(spec.namespace(functions=functions))
        return {name: names[name] for name in found}

    def decode_symbols(
        count: int, frequencies: list[int], precision: int, states: list[int], words: list[int], word_bit: int
    ) -> tuple[Any, int]:
        symbols, states[:], needed = decode_lanes(count, frequencies, precision, states, words)
        if needed > len(words):
            raise names["Fault"]("R-7-1", word_bit)
        return symbols, needed

    names.update(spec.namespace(functions={**functions, "decode_symbols": decode_symbols}))
    return {name: names[name] for name in (*found, *PLANE_OPERATIONS)}


Field = tuple[Any, int]
"""The vectors of a motion field, i8 (rows, columns, 2), and the side of its cells in pixels, 0 for none."""


@dataclass(frozen=True)
class MainBody:
    """What the host finds in a frame_body() of profile `main` (spec.md 15.5) that has symbols.

    Attributes
    ----------
    width, height
        Of the frame.
    quantizer
        The one that holds in the frame.
    motion_cell
        As it is written.
    inherited
        What `motion_cell` 0 stands for.
    new_mark
        What the new splats have for p of section 15.11: 0 in an I-frame, 2 in a P-frame.
    count
        The number of new splats.
    planes
        `density_family`, `scale_code`, `centre` and `slope` of each plane, the last two without what was added to them;
        none where no densities were written so far.
    alphas
        α of each halving.
    lane_states
        At the start.
    words_of_groups
        The number of the first word of each group, and of the one after the last word that there may be.
    data
        The bytes after the last `word_count`: words from the start, raw bits from the end.
    """

    width: int
    height: int
    quantizer: int
    motion_cell: int
    inherited: "Field"
    new_mark: int
    count: int
    planes: Sequence[tuple[int, int, int, int]]
    alphas: Sequence[int]
    lane_states: Sequence[int]
    words_of_groups: Sequence[int]
    data: bytes


@dataclass(frozen=True)
class MainFrame:
    """What a back end has made of a `MainBody`.

    Attributes
    ----------
    state
        The `MainState` after the frame.
    vectors, modes, differences
        i8 (rows, columns, 2), (N,) and (N, 8), as section 15.12 has them; empty where there are none.
    lane_states
        At the end.
    taken
        The number of the word after the last one that each group needed.
    early_bits, late_bits
        How many raw bits there are of both kinds.
    symbols
        c(s), f(s), pass and lane of each symbol, (S, 4), in the order of decoding.
    """

    state: Any
    vectors: Any
    modes: Any
    differences: Any
    lane_states: Sequence[int]
    taken: Sequence[int]
    early_bits: int
    late_bits: int
    symbols: Any


class MainBackEnd(Protocol):
    """What decodes frames of profile `main`. A state is a value: frames make new ones and leave the old ones alone."""

    def no_splats(self) -> Any:
        """The state before an I-frame; its `len` is the number of splats, and `numpy.asarray` gives them as i8."""

    def decode(self, state: Any, body: MainBody) -> MainFrame:
        """A frame; where words or raw bits are missing they may be any numbers."""

    def carried(self, state: Any, field: Field) -> Any:
        """The state of a layer without a chunk, whose splats move by a field: section 15.13."""

    def parameters(self, state: Any) -> Any:
        """The parameters f4 (N, 8) of a state, or of splats i8 (N, 8)."""

    def work(self, state: Any, width: int, height: int, halvings: int) -> int:
        """The rendering work of a state, or of splats i8 (N, 8): (5-2)."""


MAIN_OPERATIONS: Final = (*STREAM_OPERATIONS, "read_main_stream", "reconstruct_layers")
"""The operations of spec.md on streams of profile `main`."""


def main_functions(back_end: MainBackEnd, names: dict[str, Any]) -> dict[str, Any]:
    """The functions of spec.md 15.12 and 15.13 that hand the bodies of frames to a back end.

    Parameters
    ----------
    back_end
        It decodes what is after the elements of a body, and keeps the splats.
    names
        The names of the code that the functions are put into; it may be filled afterwards.
    """

    class MainState:
        """What the code of section 15.12 carries from frame to frame."""

        def __init__(self) -> None:
            self.forget()

        def forget(self) -> None:
            self.splats = back_end.no_splats()
            self.densities: dict[str, Any] | None = None
            self.quantizer: int | None = None
            self.inherited: Field = np.zeros((0, 0, 2), np.int64), 0

    def copied(main: MainState) -> MainState:
        other = MainState()
        other.splats, other.densities, other.quantizer = main.splats, main.densities, main.quantizer
        return other

    def carried(main: MainState, moves: Field) -> MainState:
        other = copied(main)
        other.splats = back_end.carried(main.splats, moves)
        return other

    def read_main_body(p: Any, frame_type: str, main: MainState, header: Any, limits: Any) -> dict[str, Any]:
        body: dict[str, Any] = names["read_body_head"](p, frame_type, main, header, limits)
        size = header["width"], header["height"]
        if body["densities_present"]:
            main.densities = names["read_densities"](p, names["halving_count"](*size))
        body.update(field=np.zeros((0, 0, 2), np.int64), modes=np.zeros(0, np.int64), q=np.zeros((0, 8), np.int64))
        body["symbols"] = []
        if body["count"] + len(main.splats) == 0:
            return body
        run = names["Run"](p, body["lane_exponent"])
        planes, alphas = _told(main.densities)
        mark = 0 if frame_type == "I" else 2
        told = MainBody(
            *size, body["quantizer"], body["motion_cell"], main.inherited, mark, body["count"], planes, alphas,
            run.states, run.ends, run.data,
        )  # fmt: skip
        frame = back_end.decode(main.splats, told)
        if any(taken > end for taken, end in zip(frame.taken, run.ends[1:], strict=True)):
            raise names["Fault"]("R-7-1", run.word_bit)
        run.states, run.taken, run.at = frame.lane_states, frame.taken, frame.early_bits
        run.begin_late(frame.late_bits)
        main.splats = frame.state
        body.update(field=frame.vectors, modes=frame.modes, q=frame.differences, symbols=frame.symbols)
        return body

    def _told(densities: dict[str, Any] | None) -> tuple[list[tuple[int, int, int, int]], list[int]]:
        if densities is None:
            return [], []
        *planes, alphas = densities.values()
        return [(int(T is names["LAPLACE"]), *rest) for T, *rest in planes], alphas

    def state_parameters(state: Any) -> dict[str, Any]:
        return {"parameters": back_end.parameters(state)}

    def main_work(state: Any, width: int, height: int, halvings: int) -> dict[str, Any]:
        return {"work": np.array(back_end.work(state, width, height, halvings), np.int64)}

    own = (MainState, copied, carried, read_main_body, state_parameters, main_work)
    return {function.__name__: function for function in own}
