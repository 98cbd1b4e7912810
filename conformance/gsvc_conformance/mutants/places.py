"""Lines of spec.md's code that stand at several places, each with enough around it to occur once.

A mistake that both profiles, or frames and layers, may have in common is made at all of these places.
"""

from typing import Final

Patches = tuple[tuple[str, str], ...]

FRAMES: Final = (
    '    frame = {"type": frame_type, "survivors": np.zeros(0, np.uint16), "inter": None, "intra": None}\n',
    '    frame = {"type": frame_type}\n',
)
"""The first lines of the functions that read a frame, of profile `paper` and of `main`."""
NUMBER: Final = '    frame["frame_number"] = p.uv()\n    if frame["frame_number"] != state.next_number:  # R-6.4-1\n'
FLAG: Final = '        raise Fault("R-6.4-1", p.element)\n    frame["parameter_checksum"] = None\n    if state.header["flags"] & 1:\n'
CHECK_LIMIT: Final = '    """A rule by `level`, and R-5-9; an amount for each."""\n'
"""The first line of the function in which splats and work are held against the level."""
ERROR: Final = '        error = f"{fault.kind} {fault.rule} {fault.bit}"\n'
COUNTS: Final = "    counts = np.array([len(part) for part in parameters], np.int64)\n"


def in_frames(after: str, old: str, new: str) -> Patches:
    """Lines `old` after the lines `after` at the beginning of a frame of either profile, and what replaces them."""
    return tuple((first + after + old, first + after + new) for first in FRAMES)


def frame_numbers(test: str) -> Patches:
    """Another test of `frame_number`."""
    read, _, _ = NUMBER.partition("    if")
    return in_frames(read, NUMBER.removeprefix(read), f"    if {test}:\n")


def modulo(bits: int) -> Patches:
    """A test of so many lower bits of `frame_number`."""
    return frame_numbers(f'frame["frame_number"] % 2**{bits} != state.next_number % 2**{bits}')


def all_work(new: str) -> Patches:
    """A line about the work of frames and of layers, before it is held against the level."""
    return ((CHECK_LIMIT, f'{CHECK_LIMIT}    if name == "work":\n        {new}\n'),)
