"""Effects: steps of an encode that are taken on every frame, or only where the scene calls for them."""

from dataclasses import dataclass, fields, replace
from typing import Any, Final, Literal, Self, get_args, get_type_hints

from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError

Mode = Literal["auto", "all", "off"]
"""``auto``: where the scene calls for the effect; ``all``: on every frame; ``off``: nowhere."""

EffectName = Literal["frames", "regions", "gsa", "dks", "gsp", "motion"]

EFFECT_NAMES: Final[tuple[EffectName, ...]] = get_args(EffectName)

MAIN_MODES: Final[dict[EffectName, tuple[Mode, ...]]] = {
    "frames": ("auto", "all"),
    "regions": ("auto",),
    "gsa": ("auto", "off"),
    "dks": ("auto", "all", "off"),
    "gsp": ("auto",),
    "motion": ("auto", "off"),
}
"""The modes that each effect has in profile `main`."""


@dataclass(frozen=True)
class Effects:
    """The mode of each effect: ``auto`` where the scene calls for it, ``all`` on every frame, ``off`` nowhere."""

    # ``auto``: a frame that equals the one before becomes an R-frame without a step; ``all``: every frame is coded
    frames: Literal["auto", "all"] = "auto"
    # ``auto``: what changes too little to be seen stays as it is; ``all``: every change of a splat is coded
    regions: Literal["auto", "all"] = "auto"
    # Splats added to P-frames. ``auto``: to those that are predicted worse than the frame before is; ``all``: to every
    # P-frame (paper section 3.5); ``off``: none.
    gsa: Literal["auto", "all", "off"] = "auto"
    # Key frames when `Settings.key_frames` is ``auto``. ``auto``: only frames that a cheap measure suspects are
    # pre-trained; ``all``: every frame, twice (paper section 3.6); ``off``: no key frame but the first.
    dks: Literal["auto", "all", "off"] = "auto"
    # Splats removed. ``auto``: only those that the rate has no room for; ``all``: as many as are added, and with preset
    # ``paper`` during every fit (paper section 3.4); ``off``: none, so that splats are added only while there is room.
    gsp: Literal["auto", "all", "off"] = "auto"
    # ``auto``: P-frames begin with the splats moved along the optical flow, where that brings the picture closer;
    # ``off``: never. Ours, not the paper's.
    motion: Literal["auto", "off"] = "auto"

    def __post_init__(self) -> None:
        check_types(self)

    @classmethod
    def parse(cls, text: str) -> Self:
        """The effects of a text such as ``auto`` or ``auto,gsa=off,dks=all``: a base, then switches by name."""
        base, *switches = [part.strip() for part in text.split(",")]
        if base not in ("auto", "all"):
            raise UsageError(f"effects {text!r} begin with {base!r}; give auto or all first, then for instance gsa=off")
        effects = cls() if base == "auto" else cls("all", "all", "all", "all", "all", "off")
        given: dict[str, Any] = {}
        allowed = {name: get_args(hint) for name, hint in get_type_hints(cls).items()}
        for switch in switches:
            name, equals, mode = (part.strip() for part in switch.partition("="))
            if not equals or name not in allowed:
                raise UsageError(f"effects {text!r} have {switch!r}; give NAME=MODE, NAME one of {', '.join(allowed)}")
            if mode not in allowed[name]:
                raise UsageError(f"effects {text!r}: {name} is {mode!r}; it must be {' or '.join(allowed[name])}")
            given[name] = mode
        return replace(effects, **given)

    def check_main(self) -> None:
        """Refuse modes that profile `main` does not have."""
        for name, modes in MAIN_MODES.items():
            if (mode := self.mode(name)) not in modes:
                allowed = "; ".join(f"{other}={'|'.join(those)}" for other, those in MAIN_MODES.items())
                raise UsageError(
                    f"effects {self}: {name}={mode} is of profile paper; in profile main the bits that it costs decide "
                    f"which splat changes, comes or goes. It has {allowed}"
                )

    def mode(self, name: EffectName) -> Mode:
        """The mode of an effect."""
        mode: Mode = getattr(self, name)
        return mode

    def __str__(self) -> str:
        """The shortest text that `parse` makes these effects of."""
        texts = []
        for base in ("auto", "all"):
            start = self.parse(base)
            switched = [field.name for field in fields(self) if getattr(self, field.name) != getattr(start, field.name)]
            texts.append(",".join([base, *(f"{name}={getattr(self, name)}" for name in switched)]))
        return min(texts, key=len)
