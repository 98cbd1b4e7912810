"""PNG against itself, against Pillow, and against damage."""

import io
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from gsvc_base.errors import GsvcError
from gsvc_ref.video import ColorDescription, decode_png, encode_png
from gsvc_ref.video.png import PNG_SIGNATURE


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(body, zlib.crc32(kind)))


def png(header, *chunks):
    return PNG_SIGNATURE + chunk(b"IHDR", struct.pack(">IIBBBBB", *header)) + b"".join(chunks) + chunk(b"IEND", b"")


def pillow_png(picture, **options):
    file = io.BytesIO()
    picture.save(file, "PNG", **options)
    return file.getvalue()


def random_frame(height, width, bit_depth, seed):
    peak = (1 << bit_depth) - 1
    rng = np.random.default_rng(seed)
    smooth = rng.integers(0, peak + 1) // 2 + np.add.outer(np.arange(height), np.arange(width))[..., None] * [1, 2, 3]
    frame = rng.integers(0, peak + 1, (height, width, 3)) if seed % 2 else smooth % (peak + 1)
    return frame.astype(np.uint8 if bit_depth == 8 else np.uint16)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(8, 16), st.integers(0, 2**32))
def test_round_trip(height, width, bit_depth, seed):
    frame = random_frame(height, width, bit_depth, seed)
    image = decode_png(encode_png(frame, bit_depth), "x")
    assert image.bit_depth == bit_depth
    assert image.frame.dtype == frame.dtype
    assert image.notes == []
    np.testing.assert_array_equal(image.frame, frame)


@pytest.mark.parametrize("bit_depth", range(9, 17))
def test_every_sample_of_every_depth_comes_back(bit_depth):
    frame = np.resize(np.arange(1 << bit_depth, dtype=np.uint16), ((1 << bit_depth) // 96 + 1, 32, 3))
    np.testing.assert_array_equal(decode_png(encode_png(frame, bit_depth), "x").frame, frame)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 2**32))
def test_pillow_reads_what_is_written(height, width, seed):
    frame = random_frame(height, width, 8, seed)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(encode_png(frame)))), frame)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 2**32), st.sampled_from(["1", "L", "P", "RGB", "I;16"]))
def test_what_pillow_writes_is_read(height, width, seed, mode):
    frame = random_frame(height, width, 8, seed)
    if mode == "I;16":
        grey = random_frame(height, width, 16, seed)[..., 0]
        picture, expected, bit_depth = Image.fromarray(grey), np.repeat(grey[..., None], 3, axis=-1), 16
    else:
        picture = Image.fromarray(frame)
        picture = picture.quantize(13) if mode == "P" else picture.convert(mode)
        expected, bit_depth = np.asarray(picture.convert("RGB")), 8
    image = decode_png(pillow_png(picture), "x")
    assert image.bit_depth == bit_depth
    np.testing.assert_array_equal(image.frame, expected)


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_shallow_grey_is_scaled_to_8_bits(depth):
    rows = zlib.compress(b"\0" + bytes([0b11100100 if depth == 2 else 0b11110000]))
    image = decode_png(png((8 // depth, 1, depth, 0, 0, 0, 0), chunk(b"IDAT", rows)), "x")
    expected = {1: [255] * 4 + [0] * 4, 2: [255, 170, 85, 0], 4: [255, 0]}[depth]
    np.testing.assert_array_equal(image.frame[0, :, 0], expected)


def picked(width, height):
    """The passes of Adam7 by the pattern that the standard prints: for each row of each pass its columns."""
    pattern = np.array([list(map(int, row)) for row in ["16462646", "77777777", "56565656", "77777777"] * 2])
    pattern[4] = [3, 6, 4, 6, 3, 6, 4, 6]
    number = np.tile(pattern, (height // 8 + 1, 1))[:height, np.arange(width) % 8]
    rows = [(y, np.flatnonzero(number[y] == p)) for p in range(1, 8) for y in range(height)]
    return [(y, columns) for y, columns in rows if len(columns)]


@pytest.mark.parametrize("interlaced", [0, 1])
@pytest.mark.parametrize(("width", "height"), [(1, 1), (2, 3), (5, 4), (8, 8), (9, 17)])
@pytest.mark.parametrize(("color_type", "channels"), [(0, 1), (2, 3), (4, 2), (6, 4)])
@pytest.mark.parametrize("depth", [8, 16])
def test_pictures_of_every_type_in_rows_and_in_passes(width, height, color_type, channels, depth, interlaced):
    rng = np.random.default_rng(width)
    samples = rng.integers(0, 1 << depth, (height, width, channels)).astype(f">u{depth // 8}")
    if channels in (2, 4):
        samples[..., -1] = (1 << depth) - 1
    rows = picked(width, height) if interlaced else [(y, np.arange(width)) for y in range(height)]

    def decoded():
        data = b"".join(b"\0" + samples[y, columns].tobytes() for y, columns in rows)
        return decode_png(
            png((width, height, depth, color_type, 0, 0, interlaced), chunk(b"IDAT", zlib.compress(data))), "x"
        )

    image = decoded()
    assert image.bit_depth == depth
    assert image.frame.dtype == (np.uint8 if depth == 8 else np.uint16)
    expected = samples[..., :3] if channels > 2 else np.broadcast_to(samples[..., :1], (height, width, 3))
    np.testing.assert_array_equal(image.frame, expected)
    if channels in (2, 4):
        samples[-1, -1, -1] -= 1
        with pytest.raises(GsvcError, match="transparent"):
            decoded()


@pytest.mark.parametrize(
    ("depth", "color_type", "row"), [(1, 0, 0x50), (2, 0, 0x1B), (4, 0, 0x1F), (16, 0, 1), (16, 2, 1)]
)
def test_a_transparent_sample_is_one_of_the_depth_of_the_file(depth, color_type, row):
    """Not one that is scaled to 8 bits."""
    channels = 3 if color_type == 2 else 1
    peak = (1 << depth) - 1
    width = max(1, 8 // depth)
    data = b"\0" + (bytes([row]) if depth < 16 else bytes([0xAB, 0xCD] * channels))
    present = [row >> (8 - depth * (i + 1)) & peak for i in range(width)] if depth < 16 else [0xABCD]
    for key in {0, 1, peak, 0xAB, 0xABCC, 0xABCD}:
        transparency = chunk(b"tRNS", struct.pack(">H", key) * channels)
        file = png((width, 1, depth, color_type, 0, 0, 0), transparency, chunk(b"IDAT", zlib.compress(data)))
        if key in present:
            with pytest.raises(GsvcError, match="transparent"):
                decode_png(file, "x")
        else:
            assert len(decode_png(file, "x").notes) == 1


@pytest.mark.parametrize("kind", range(5))
def test_every_row_filter(kind):
    frame = random_frame(5, 4, 8, 1)
    rows = frame.reshape(5, 12).astype(int)
    left, above, corner = np.zeros((3, 5, 12), int)
    left[:, 3:], above[1:], corner[1:, 3:] = rows[:, :-3], rows[:-1], rows[:-1, :-3]
    near = np.stack([left, above, corner])
    closest = np.argmin(np.abs(left + above - corner - near), axis=0)
    paeth = np.take_along_axis(near, closest[None], axis=0)[0]
    predicted = [np.zeros_like(rows), left, above, (left + above) // 2, paeth][kind]
    filtered = np.hstack([np.full((5, 1), kind), (rows - predicted) % 256]).astype(np.uint8)
    data = png((4, 5, 8, 2, 0, 0, 0), chunk(b"IDAT", zlib.compress(filtered.tobytes())))
    np.testing.assert_array_equal(decode_png(data, "x").frame, frame)


def test_color_is_stored_and_read():
    frame = np.zeros((2, 2, 3), np.uint16)
    color = ColorDescription(9, 16, 1, False, 2)
    assert decode_png(encode_png(frame, 10, color), "x").color == ColorDescription(9, 16, 0, True, 0)
    unknown = ColorDescription(2, 2, 1, False, 2)
    assert decode_png(encode_png(frame, 10, unknown), "x").color == ColorDescription(2, 2, 0, True, 0)


def test_color_chunks_of_others():
    row = chunk(b"IDAT", zlib.compress(bytes(4)))
    header = (1, 1, 8, 2, 0, 0, 0)
    assert decode_png(png(header, chunk(b"sRGB", b"\0"), row), "x").color.transfer == 13
    assert decode_png(png(header, chunk(b"iCCP", b"p"), row), "x").notes == [
        "an ICC profile is not applied: samples are taken as they are"
    ]
    assert decode_png(png(header, chunk(b"acTL", b"p"), row), "x").notes == [
        "of an animated PNG only the still picture is read"
    ]
    with pytest.raises(GsvcError, match="only full-range"):
        decode_png(png(header, chunk(b"cICP", b"\1\1\0\0"), row), "x")


@pytest.mark.parametrize("mode", ["LA", "RGBA"])
def test_alpha_must_be_opaque(mode):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (4, 5, len(mode)), dtype=np.uint8)
    pixels[..., -1] = 255
    image = decode_png(pillow_png(Image.fromarray(pixels)), "x")
    np.testing.assert_array_equal(image.frame, np.broadcast_to(pixels[..., :-1], (4, 5, 3)))
    assert image.notes == ["an alpha channel that is opaque everywhere was dropped"]
    pixels[3, 4, -1] = 254
    with pytest.raises(GsvcError, match=r"x is transparent in places.*flatten") as caught:
        decode_png(pillow_png(Image.fromarray(pixels)), "x")
    assert caught.value.kind == "unsupported"


def test_transparent_colours():
    picture = Image.fromarray(random_frame(4, 5, 8, 1))
    present = tuple(int(sample) for sample in np.asarray(picture)[2, 3])
    palette = picture.quantize(8)
    assert decode_png(pillow_png(picture, transparency=(1, 2, 3)), "x").notes != []
    for data in (pillow_png(picture, transparency=present), pillow_png(palette, transparency=0)):
        with pytest.raises(GsvcError, match="transparent"):
            decode_png(data, "x")
    assert decode_png(pillow_png(palette, transparency=bytes([255] * 8)), "x").notes != []


ROW = chunk(b"IDAT", zlib.compress(bytes(4)))


@pytest.mark.parametrize(
    ("data", "kind", "message"),
    [
        (b"", "malformed", "signature"),
        (PNG_SIGNATURE, "malformed", "cut off"),
        (PNG_SIGNATURE + ROW + chunk(b"IEND", b""), "malformed", "first chunk is not IHDR"),
        (PNG_SIGNATURE + chunk(b"IHDR", b"") + chunk(b"IEND", b""), "malformed", "13 bytes"),
        (png((0, 1, 8, 2, 0, 0, 0), ROW), "malformed", "at least 1"),
        (png((70000, 1, 8, 2, 0, 0, 0), ROW), "limit", "65535"),
        (png((65535, 65535, 16, 6, 0, 0, 0), ROW), "limit", "pixels"),
        (png((1, 1, 8, 5, 0, 0, 0), ROW), "malformed", "do not exist"),
        (png((1, 1, 4, 2, 0, 0, 0), ROW), "malformed", "do not exist"),
        (png((1, 1, 8, 2, 1, 0, 0), ROW), "malformed", "do not exist"),
        (png((1, 1, 8, 2, 0, 0, 2), ROW), "malformed", "do not exist"),
        (png((1, 1, 8, 2, 0, 0, 0)), "malformed", "another length than the 4 bytes"),
        (png((2, 1, 8, 2, 0, 0, 0), ROW), "malformed", "another length than the 7 bytes"),
        (png((9999, 9999, 8, 2, 0, 0, 0), ROW), "malformed", "another length"),
        (png((1, 1, 8, 2, 0, 0, 0), chunk(b"IDAT", zlib.compress(bytes(9)))), "malformed", "another length"),
        (png((1, 1, 8, 2, 0, 0, 0), chunk(b"IDAT", b"junk")), "malformed", "inflated"),
        (
            png((1, 1, 8, 2, 0, 0, 0), chunk(b"IDAT", zlib.compress(b"\5\0\0\0"))),
            "malformed",
            "picture data cannot be read",
        ),
        (png((1, 1, 8, 2, 0, 0, 0), chunk(b"ABCD", b""), ROW), "malformed", "critical chunk"),
        (png((1, 1, 8, 2, 0, 0, 0), chunk(b"tRNS", b"abc"), ROW), "malformed", "tRNS"),
        (png((1, 1, 8, 2, 0, 0, 0), chunk(b"cICP", b"abc"), ROW), "malformed", "cICP"),
        (png((1, 1, 8, 3, 0, 0, 0), chunk(b"IDAT", zlib.compress(bytes(2)))), "malformed", "palette has 0 bytes"),
        (
            png((1, 1, 8, 3, 0, 0, 0), chunk(b"PLTE", b"abc"), chunk(b"IDAT", zlib.compress(b"\0\1"))),
            "malformed",
            "colour 1 of a palette of 1",
        ),
        (png((1, 1, 8, 2, 0, 0, 0), ROW)[:-4], "malformed", "cut off"),
    ],
)
def test_damaged_files(data, kind, message):
    with pytest.raises(GsvcError, match=message) as caught:
        decode_png(data, "x")
    assert caught.value.kind == kind


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 400), st.integers(1, 255))
def test_a_changed_byte_is_noticed(seed, place, change):
    frame = random_frame(5, 6, 8, seed)
    data = bytearray(encode_png(frame, 8, ColorDescription(1, 13, 0, True, 0)))
    place %= len(data)
    data[place] ^= change
    with pytest.raises(GsvcError, match=r"^(malformed|limit): "):
        decode_png(bytes(data), "x")
