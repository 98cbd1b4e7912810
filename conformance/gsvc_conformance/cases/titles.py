"""Words in titles of cases for what their keys abbreviate."""

from collections.abc import Iterable
from typing import Final

NAMES: Final = {
    "bt601": "BT.601", "bt709": "BT.709", "bt470": "BT.470", "bt2020": "BT.2020", "fcc": "FCC",
    "smpte240m": "SMPTE 240M", "identity": "the identity", "ycgco": "YCgCo", "limited": "limited range",
    "full": "full range", "420": "4:2:0", "422": "4:2:2", "444": "4:4:4",
}  # fmt: skip


def in_words(keys: Iterable[str]) -> dict[str, str]:
    """Keys of matrix, range, chroma format and depth as a title has them, such as "BT.709, limited range, 4:2:0"."""
    return {key: ", ".join(NAMES.get(part, part) for part in key.replace("_bits", " bits").split("_")) for key in keys}
