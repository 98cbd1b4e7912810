"""SVG figures of matplotlib in the colours of light and of dark pages, by one rule for new and for kept ones."""

import re
from typing import Final

DARK: Final = {
    "#ffffff": "#131619",  # paper
    "#000000": "#f2f4f5",
    "#1a1e23": "#e7eaec",
    "#5b6570": "#9ba5af",
    "#7f7f7f": "#a4acb3",
    "#c8cdd2": "#454c54",
    "#dfe2e5": "#30363d",  # grid
    "#0072b2": "#5ab4f0",
    "#56b4e9": "#8fd0f5",
    "#d55e00": "#ff8a3d",
    "#009e73": "#3cc99f",
    "#cc79a7": "#e59ac4",
    "#e69f00": "#f2b53c",
}
"""The colours of figures on light paper, and what takes their place on dark paper."""

_STYLE: Final = re.compile(r"(<style type=\"text/css\">[^<@]*)(@media[^<]*)?(</style>)")
"""The style sheet that matplotlib writes."""


def in_both_schemes(svg: str) -> str:
    """The figure with a style sheet that gives it dark paper where the reader prefers a dark scheme.

    The figure keeps its paper: on a page of the other scheme than the system's its text could not be read without.
    A figure that has such a sheet gets it anew.
    """
    rules = [
        f'[style*="{part}: {light}"]{{{part}:{dark}!important}}'
        for light, dark in DARK.items()
        for part in ("fill", "stroke")
        if f"{part}: {light}" in svg
    ]
    text = f'text:not([style*="fill:"]){{fill:{DARK["#1a1e23"]}}}'
    sheet = f"@media (prefers-color-scheme:dark){{{text}{''.join(rules)}}}"
    return _STYLE.sub(lambda found: found[1] + sheet + found[3], svg, count=1)
