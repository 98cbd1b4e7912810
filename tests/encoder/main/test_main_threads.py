"""Whole encodes of profile `main`: the same bytes with any number of threads. Other machines: tests/machines."""

import hashlib

from codec_cases import encoded, waves

from gsvc_ref.encoder import Settings


def digest(threads: int) -> str:
    """Of a stream with an I-frame, a motion field, differences and new splats."""
    settings = Settings.quick(
        profile="main", splats=40, key_frames=(0,), threads=threads, precision="deterministic", decisions=False
    )
    return hashlib.sha256(encoded(waves(48, 40, 3, speed=2.5), settings)[1]).hexdigest()


def test_bytes_do_not_depend_on_the_threads() -> None:
    assert len({digest(threads) for threads in (1, 2, 5)}) == 1
