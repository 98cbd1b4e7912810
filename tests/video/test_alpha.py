"""Transparent pictures are refused, or shown on a background; each source of them is mixed by the same rule."""

import json

import numpy as np
import pytest
from PIL import Image

import gsvc_ref
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli import main
from gsvc_ref.video import open_video
from gsvc_ref.video.alpha import background_of, flattened
from gsvc_ref.video.png import decode_png

WIDTH, HEIGHT = 16, 12
ORANGE = (255, 165, 0)


def picture(number=0):
    """(H, W, 4) u1 with every kind of pixel: opaque, half transparent, and not there at all."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    alpha = np.select([(x + number) % WIDTH < 6, y < 5], [255, 0], 100 + number)
    return np.stack([x * 15, y * 20, (x + y) * 9, alpha], axis=-1).astype(np.uint8)


def mixed(rgba, background, peak=255):
    """The rule in floating point."""
    share = rgba[..., 3:] / peak
    return np.rint(rgba[..., :3] * share + np.rint(np.array(background) / 255 * peak) * (1 - share))


def saved(path, image, **options):
    Image.fromarray(image).save(path, **options)
    return path


@pytest.mark.parametrize(
    ("color", "samples"),
    [("white", (255, 255, 255)), ("#0a0B0c", (10, 11, 12)), ("Orange", ORANGE), ([1, 2, 3], (1, 2, 3)), (None, None)],
)
def test_colors(color, samples):
    assert background_of(color) == samples


@pytest.mark.parametrize("color", ["whitish", "#12345", "#11223344", "", (1, 2), (1, 2, 256), (1, 2, 3.5), (-1, 0, 0)])
def test_what_is_no_color_is_refused(color):
    with pytest.raises(UsageError, match="background"):
        background_of(color)


@pytest.mark.parametrize("peak", [255, 1023, 65535])
def test_mixing_is_exact_up_to_its_rounding(peak):
    rng = np.random.default_rng(peak)
    rgba = rng.integers(0, peak + 1, (40, 40, 4)).astype(np.uint8 if peak == 255 else np.uint16)
    frame = flattened(rgba[..., :3], rgba[..., 3], peak, ORANGE)
    assert frame.dtype == rgba.dtype
    assert np.abs(frame - mixed(rgba, ORANGE, peak)).max() <= (peak > 255)  # halves that floating point rounds down


@pytest.mark.parametrize("mode", ["RGBA", "LA"])
def test_a_png_on_a_background(tmp_path, mode):
    image = Image.fromarray(picture()).convert(mode)
    image.save(tmp_path / "a.png")
    image = decode_png((tmp_path / "a.png").read_bytes(), "a.png", ORANGE)
    with Image.open(tmp_path / "a.png") as read:
        np.testing.assert_array_equal(image.frame, mixed(np.asarray(read.convert("RGBA")), ORANGE))
    assert image.notes == ["transparent places of pictures show the background #ffa500"]


def test_a_transparent_palette_and_a_transparent_color(tmp_path):
    opaque = Image.fromarray(picture()[..., :3])
    palette = opaque.quantize(8)
    palette.save(tmp_path / "palette.png", transparency=bytes([0, 128]))
    with Image.open(tmp_path / "palette.png") as read:
        expected = mixed(np.asarray(read.convert("RGBA")), ORANGE)
    np.testing.assert_array_equal(decode_png((tmp_path / "palette.png").read_bytes(), "x", ORANGE).frame, expected)
    opaque.save(tmp_path / "key.png", transparency=tuple(int(sample) for sample in picture()[3, 4, :3]))
    frame = decode_png((tmp_path / "key.png").read_bytes(), "x", ORANGE).frame
    assert tuple(frame[3, 4]) == ORANGE
    assert np.array_equal(frame[0], picture()[0, :, :3])


def test_a_folder_of_pictures(tmp_path):
    for number in range(3):
        saved(tmp_path / f"{number}.png", picture(number))
    with pytest.raises(GsvcError, match=r"0\.png is transparent in places.*--background white"):
        open_video(tmp_path)
    with open_video(tmp_path, background="orange") as reader:
        for number, frame in enumerate(reader):
            np.testing.assert_array_equal(frame, mixed(picture(number), ORANGE))
        assert sum("transparent" in note for note in reader.notes) == 1


def test_every_command_takes_it(tmp_path, capsys, monkeypatch):
    """Encoded on a background, and compared on the same one."""
    monkeypatch.chdir(tmp_path)
    saved(tmp_path / "a.png", picture())
    assert main(["encode", "a.png", "a.gsvc", "--quiet"]) == 1
    assert "--background white" in capsys.readouterr().err
    assert main(["encode", "a.png", "a.gsvc", "--background", "murky", "--quiet"]) == 2
    assert "'murky' is not a color; give a name such as white, or #rrggbb" in capsys.readouterr().err
    assert main(["encode", "a.png", "a.gsvc", "--background", "#ffa500", "--splats", "40", "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert "transparent places of pictures show the background #ffa500" in notes
    scores = {}
    for color in ("orange", "black"):
        assert main(["compare", "a.png", "a.gsvc", "--background", color, "--no-vmaf", "--json"]) == 0
        scores[color] = json.loads(capsys.readouterr().out)["mean"]["psnr"]
    assert scores["orange"] > 29
    assert scores["black"] < 15
    for command in ("view", "report", "bench"):
        assert main([command, "--help"]) == 0
        assert "--background COLOR" in capsys.readouterr().out


def test_a_reader_on_a_background_is_a_source_of_encode(tmp_path):
    path = saved(tmp_path / "a.png", picture())
    with open_video(path, background="white") as reader:
        report = gsvc_ref.encode(reader, tmp_path / "a.gsvc", gsvc_ref.Settings.quick(splats=8))
    assert any("transparent places" in note for note in report.notes)
