"""`encode_frames`: frame after frame, and each group of pictures for itself."""

from codec_cases import fast, video_format, waves

from gsvc_ref.encoder.frame_types import typed_frames
from gsvc_ref.encoder.loop import encode_frames
from gsvc_ref.encoder.setup import coder_of

SMALL = video_format(24, 16)
SETTINGS = fast(key_frames=3, splats=12, quality=45)
CLIP = waves(24, 16, 7)


def typed(clip=CLIP):
    return list(typed_frames(clip, SETTINGS, SMALL.peak))


def codes(encoded):
    return [(frame.number, frame.codes.type, frame.state.splats.to_array().tobytes()) for frame in encoded]


def test_a_frame_is_encoded_when_it_is_asked_for():
    read = []

    def source():
        for frame in typed():
            read.append(frame.number)
            yield frame

    encoded = encode_frames(source(), coder_of(SETTINGS, SMALL))
    assert next(encoded).number == 0
    assert read == [0]
    assert [frame.number for frame in encoded] == [1, 2, 3, 4, 5, 6]


def test_frames_say_what_was_decided_about_them():
    first, second, *_ = encode_frames(typed(), coder_of(SETTINGS, SMALL))
    assert (first.codes.type, first.reason) == ("I", "first frame")
    assert (second.codes.type, second.reason) == ("P", "predicted")
    assert {decision.effect for decision in second.decisions} == {decision.effect for decision in first.decisions}
    assert first.elapsed_s > 0


def test_a_group_is_encoded_as_if_it_were_alone():
    """By a coder that another process could have, made when the first frame was encoded."""
    frames = typed()
    coder = coder_of(SETTINGS, SMALL)
    whole = codes(encode_frames(frames, coder))
    first, *_ = encode_frames(frames[:1], alone := coder_of(SETTINGS, SMALL))
    assert first.number == 0
    later = codes(encode_frames(frames[3:6], alone.for_group()))
    assert later == whole[3:6]


def test_stages_are_watched_frame_by_frame():
    seen = []
    watch = lambda number: lambda stage, done, iterations, psnr: seen.append((number, stage))  # noqa: E731
    list(encode_frames(typed(CLIP[:2]), coder_of(SETTINGS, SMALL), watch))
    assert {number for number, _ in seen} == {0, 1}
    assert {stage for _, stage in seen} == {"encode"}
