"""The profile of a vector: an implementation that claims it must pass the vector (spec.md section 13.1)."""

from typing import Final

from gsvc_conformance.operation import Operation, Values
from gsvc_conformance.pairs import sections

PROFILES: Final = ("paper", "main")
"""The profiles of spec.md section 5, by their values."""
ANY: Final = "any"
"""The profile of vectors that every claim needs."""

OF_PAPER: Final = (
    "decode_plane", "encode_plane", "reconstruct_intra", "reconstruct_inter", "lsq_quantize", "lsq_dequantize",
    "lsq_gradients", "rvq_assign", "rvq_update", "commitment",
)  # fmt: skip
"""Operations without a stream that sections 6.5 to 8 and 10.5 to 10.6 define."""
SECTION_OF_MAIN: Final = "15."
"""What the numbers of sections begin with that define an operation of profile `main` alone."""
WORK_OF_MAIN: Final = "main_work"
"""The operation of profile `main` alone that section 5 defines."""


def of_main(name: str) -> bool:
    """Whether an operation is of profile `main` alone."""
    return name == WORK_OF_MAIN or sections().get(name, "").startswith(SECTION_OF_MAIN)


def profile_of(operation: Operation, inputs: Values) -> str:
    """The profile of a vector, or `ANY`.

    Of a stream it is the profile that its header states; a stream from which none can be read is of every profile.

    Parameters
    ----------
    operation
        The operation of the vector.
    inputs
        Its inputs, by name.
    """
    if streams := [value for value in inputs.values() if isinstance(value, bytes)]:
        stated = {profile for profile in map(stated_profile, streams) if profile != ANY}
        return max(stated, key=PROFILES.index, default=ANY)
    if of_main(operation.name):
        return "main"
    return "paper" if operation.name in OF_PAPER else ANY


def stated_profile(stream: bytes) -> str:
    """The profile of a sequence header that stands where it must; `ANY` where none can be read."""
    from gsvc_conformance.level import header_payload

    stated = header_payload(stream)[:1]
    return PROFILES[stated[0]] if stated and stated[0] < len(PROFILES) else ANY
