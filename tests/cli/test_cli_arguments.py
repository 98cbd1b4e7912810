from argparse import ArgumentTypeError

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_ref.cli.arguments import finite, frame_range, key_frames, positive, size, whole

numbers = st.integers(0, 10**9 - 1)


@given(numbers, st.one_of(st.none(), numbers))
def test_frame_range_is_half_open_and_never_empty(start, stop):
    text = f"{start}:{'' if stop is None else stop}"
    if stop is None or stop > start:
        assert frame_range(text) == (start, stop)
    else:
        with pytest.raises(ArgumentTypeError, match="holds no frame"):
            frame_range(text)


def test_frame_range_begins_at_zero_when_nothing_is_said():
    assert frame_range(":60") == (0, 60)
    assert frame_range(":") == (0, None)


@given(st.lists(numbers, min_size=2))
def test_key_frames_lists_numbers(listed):
    assert key_frames(",".join(map(str, listed))) == tuple(listed)


def test_key_frames_tells_a_period_from_a_list_of_one():
    assert key_frames("auto") == "auto"
    assert key_frames("12") == 12
    assert key_frames("12,") == (12,)


@pytest.mark.parametrize(
    ("convert", "text"),
    [
        (frame_range, "30"),
        (frame_range, "30-60"),
        (frame_range, "-1:2"),
        (frame_range, "٣:٦"),
        (key_frames, ""),
        (key_frames, "-3"),
        (key_frames, ",1"),
        (key_frames, "1,,2"),
        (finite, "nan"),
        (finite, "inf"),
        (finite, "high"),
        (positive, "0"),
        (positive, "-2"),
        (whole, "1.5"),
        (whole, ""),
        (whole, "9" * 30),
        (size, "192"),
        (size, "0x112"),
        (size, "192*112"),
    ],
)
def test_what_is_not_allowed_is_quoted(convert, text):
    with pytest.raises(ArgumentTypeError) as caught:
        convert(text)
    assert repr(text) in str(caught.value)


def test_numbers_and_sizes():
    assert finite("34.5") == 34.5
    assert positive("0.5") == 0.5
    assert whole("-7") == -7
    assert size("192x112") == (192, 112)
