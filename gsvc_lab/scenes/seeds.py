"""Random generators of a scene: each of its own, by names and numbers, not by the order of their use."""

from zlib import crc32

from gsvc_base.draws import Draws


def generator(seed: int, name: str, *numbers: int) -> Draws:
    """The generator of a part of a scene.

    `seed`: seed of the scene. `name`: name of the part, such as the kind of an effect. `numbers`: numbers that tell
    parts apart, such as that of a frame; 0 or more each.
    """
    return Draws([seed, crc32(name.encode()), *numbers])
