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

STREAM_OPERATIONS: Final = ("reconstruct_stream", "decode_stream", "decode_stream_deterministic")
"""The operations of spec.md that call the back end."""

PLANE_OPERATIONS: Final = ("read_stream", "decode_plane")
"""The further operations of spec.md that decode planes."""


def stream_operations(
    back_end: Mapping[str, Callable[..., Any]],
    decode_lanes: LaneDecoder | None = None,
    main_profile: "MainBackEnd | None" = None,
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
    """
    names: dict[str, Any] = {}
    functions = dict(back_end)
    found: Sequence[str] = STREAM_OPERATIONS
    if main_profile is not None:
        functions |= main_functions(main_profile, names)
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


@dataclass(frozen=True)
class MainBody:
    """What the host finds in a frame_body() of profile `main` (spec.md 15.5) that has symbols.

    Attributes
    ----------
    width, height
        Of the frame.
    quantizer, motion_cell
        As they are written.
    new_mark
        What the new splats have for p of section 15.11: 0 in an I-frame, 2 in a P-frame.
    count
        `splat_count` or `new_splat_count`.
    planes
        `density_family`, `scale_code`, `centre` and `slope` of each plane, the last two without what was added to them;
        none where no densities were written so far.
    alphas
        α of each halving.
    lane_states
        u4 (lanes,).
    words
        u2 (n,).
    """

    width: int
    height: int
    quantizer: int
    motion_cell: int
    new_mark: int
    count: int
    planes: Sequence[tuple[int, int, int, int]]
    alphas: Sequence[int]
    lane_states: Any
    words: Any


@dataclass(frozen=True)
class MainFrame:
    """What a back end has made of a `MainBody`.

    Attributes
    ----------
    state
        The `MainState` behind the frame.
    vectors, modes, differences
        i8 (rows, columns, 2), (N,) and (N, 8), as section 15.12 has them; empty where there are none.
    lane_states
        At the end.
    taken
        How many words were needed.
    """

    state: Any
    vectors: Any
    modes: Any
    differences: Any
    lane_states: Sequence[int]
    taken: int


class MainBackEnd(Protocol):
    """What decodes frames of profile `main`. A state is a value: frames make new ones and leave the old ones alone."""

    def no_splats(self) -> Any:
        """The state before an I-frame; its `len` is the number of splats, and `numpy.asarray` gives them as i8."""

    def decode(self, state: Any, body: MainBody) -> MainFrame:
        """A frame; where words are missing they may be any numbers."""

    def parameters(self, state: Any) -> Any:
        """The parameters f4 (N, 8) of a state."""


MAIN_OPERATIONS: Final = (*STREAM_OPERATIONS, "read_main_stream", "reconstruct_layers")
"""The operations of spec.md on streams of profile `main`."""


def main_functions(back_end: MainBackEnd, names: dict[str, Any]) -> dict[str, Any]:
    """The functions of spec.md 15.12 and 15.13 that hand the bodies of frames to a back end.

    Parameters
    ----------
    back_end
        It decodes what is behind the elements of a body, and keeps the splats.
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

    def copied(main: MainState) -> MainState:
        other = MainState()
        other.splats, other.densities = main.splats, main.densities
        return other

    def read_main_body(p: Any, frame_type: str, main: MainState, header: Any, limits: Any) -> dict[str, Any]:
        body: dict[str, Any] = names["read_tools"](p, frame_type, main, header)
        count = body["count"] = p.uv()
        if count + len(main.splats) > limits["splats"]:
            raise names["Fault"]("R-5-2", p.element)
        names["check_densities"](body, frame_type, main)
        size = header["width"], header["height"]
        if body["densities_present"]:
            main.densities = names["read_densities"](p, names["halving_count"](*size))
        body.update(field=np.zeros((0, 0, 2), np.int64), modes=np.zeros(0, np.int64), q=np.zeros((0, 8), np.int64))
        if count + len(main.splats) == 0:
            return body
        state_bit, lane_states = _lane_states(p, 2 ** body["lane_exponent"])
        word_bit = p.position()
        words = np.frombuffer(p.raw(p.bits_left() // 16 * 2), "<u2")
        planes, alphas = _told(main.densities)
        mark = 0 if frame_type == "I" else 2
        tools = body["quantizer"], body["motion_cell"], mark
        frame = back_end.decode(main.splats, MainBody(*size, *tools, count, planes, alphas, lane_states, words))
        if frame.taken > len(words):
            raise names["Fault"]("R-7-1", word_bit)
        names["check_all_taken"](frame.lane_states, state_bit, len(words), frame.taken, word_bit)
        main.splats = frame.state
        body.update(field=frame.vectors, modes=frame.modes, q=frame.differences)
        return body

    def _lane_states(p: Any, lanes: int) -> tuple[int, Any]:
        state_bit = p.position()
        p.need(32 * lanes)
        states = []
        for _ in range(lanes):
            states.append(p.le(4))
            if states[-1] < names["LOWEST_STATE"]:
                raise names["Fault"]("R-6.6-5", p.element)
        return state_bit, np.array(states, np.uint32)

    def _told(densities: dict[str, Any] | None) -> tuple[list[tuple[int, int, int, int]], list[int]]:
        if densities is None:
            return [], []
        *planes, alphas = densities.values()
        return [(int(T is names["LAPLACE"]), *rest) for T, *rest in planes], alphas

    def state_parameters(state: Any) -> dict[str, Any]:
        return {"parameters": back_end.parameters(state)}

    own = (MainState, copied, read_main_body, state_parameters)
    return {function.__name__: function for function in own}
