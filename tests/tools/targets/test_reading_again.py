"""Sources that are read more than once."""

import io
from fractions import Fraction

import numpy as np
import pytest
from codec_cases import same, video_format, waves

from gsvc_base.errors import GsvcError, UsageError
from gsvc_lab.scenes import Scene
from gsvc_ref.encoder.source_and_target import FrameSource
from gsvc_ref.video import open_writer
from gsvc_tools.targets import reading_again
from gsvc_tools.targets.reading_again import Chosen, can_be_read_again, readable_again

CLIP = waves(8, 6, 5)
FORMAT = video_format(8, 6)


def torn():
    yield from CLIP[:2]
    raise GsvcError("malformed", "torn")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    name = tmp_path_factory.mktemp("clips") / "clip.y4m"
    with open_writer(name, video_format(8, 6)) as writer:
        for frame in CLIP:
            writer.write(frame)
    return name


def test_what_can_be_read_again(path):
    for source in (path, str(path), path.parent, "scene:pan", Scene.named("pan"), CLIP, np.array(CLIP), (CLIP, FORMAT)):
        assert can_be_read_again(source)
    for source in ("-", iter(CLIP), (iter(CLIP), FORMAT), FrameSource(CLIP, FORMAT), io.BytesIO(b"")):
        assert not can_be_read_again(source)


@pytest.mark.parametrize("kind", ["file", "list", "once"])
def test_every_pass_has_every_frame(path, kind):
    source = {"file": path, "list": (CLIP, FORMAT), "once": (iter(CLIP), FORMAT)}[kind]
    with readable_again(source, None) as opened:
        for taken in (2, 5, 5):  # the first one stops early
            with opened() as reader:
                assert (reader.format.width, reader.format.height) == (8, 6)
                assert len([frame for frame, _ in zip(reader, range(taken), strict=False)]) == taken
        with opened() as reader:
            frames = list(reader)
    if kind != "file":  # which holds Y'CbCr
        assert same(frames, CLIP)
    assert len(frames) == 5


def test_a_fault_comes_again_and_times_are_kept():
    class Timed(FrameSource):
        frame_time = None

        def __next__(self):
            frame = super().__next__()
            self.frame_time = Fraction(1, 3) if self.frame_time is None else self.frame_time * 2
            return frame

    with readable_again(Timed(torn(), FORMAT), None) as opened:
        for _ in range(2):
            reader = opened()
            times = [reader.frame_time for _ in zip(range(2), reader, strict=False)]
            assert times == [Fraction(1, 3), Fraction(2, 3)]
            with pytest.raises(GsvcError, match="torn"):
                next(reader)


def test_more_than_fits_is_refused_with_a_sentence(monkeypatch):
    monkeypatch.setattr(reading_again, "MAX_BYTES_KEPT", 3 * 8 * 6 * 3)
    with (
        readable_again((iter(CLIP), FORMAT), None) as opened,
        pytest.raises(UsageError, match="more than 3 of its frames"),
    ):
        list(opened())


def test_frames_are_chosen_by_number():
    assert same(list(Chosen(FrameSource(CLIP, FORMAT), (0, 3, 4))), [CLIP[0], CLIP[3], CLIP[4]])
    assert same(list(Chosen(FrameSource(CLIP, FORMAT), (1, 9))), [CLIP[1]])


def test_nothing_is_read_behind_the_last_frame_chosen():
    assert same(list(Chosen(FrameSource(torn(), FORMAT), (0, 1))), CLIP[:2])
    with pytest.raises(GsvcError, match="torn"):
        list(Chosen(FrameSource(torn(), FORMAT), (0, 2)))
