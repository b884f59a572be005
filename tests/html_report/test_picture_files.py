"""The files of a picture: thumbnails, and values that are those of its file, bit for bit."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np
import pytest

from illumcli.html_report import picture_files
from illumcli.html_report.entries import Picture
from illumcli.html_report.picture_files import pixels_script, reduced, thumbnail, write_picture
from illumcli.images.colors import Colors, read_colors
from illumcli.images.reader import read_image
from painted import painted
from painted import write_picture as write_image


def unpacked(script):
    """Description and values, (H, W, C), of a script: the inverse of what the page does."""
    (text,) = re.fullmatch(r'illumPixels\("[0-9a-f]+", (.*)\);\n', script).groups()
    data = json.loads(text)
    kind = np.dtype(data["type"]).newbyteorder("<")
    shape = data["channels"], kind.itemsize, data["height"], data["width"]
    planes = np.frombuffer(zlib.decompress(base64.b64decode(data.pop("data"))), np.uint8).reshape(shape)
    planes = np.add.accumulate(planes, axis=-1, dtype=np.uint8)
    values = np.ascontiguousarray(np.moveaxis(planes, 1, -1)).view(kind)[..., 0]
    return data, np.moveaxis(values, 0, -1)


NORMAL = np.random.default_rng(1).normal(size=(7, 5, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("values", "encoded", "kind"),
    [
        (painted(3) / np.float32(255), True, "uint8"),
        (painted(3) / np.float32(65535), True, "float32"),
        (NORMAL.astype(np.float16), False, "float16"),
        (NORMAL[..., :1], False, "float32"),
        (np.full((2, 3, 1), 1e6, np.float32), False, "float32"),
    ],
)  # fmt: skip
def test_values_are_stored_exactly_in_the_smallest_type(tmp_path, values, encoded, kind):
    values = values.astype(np.float32)
    script = pixels_script(Picture(tmp_path, "a", 0.5), Colors(values, encoded, {}))
    data, stored = unpacked(script)
    assert data["type"] == kind
    assert data["exposure"] == 0.5
    restored = (stored / 255).astype(np.float32) if kind == "uint8" else stored
    np.testing.assert_array_equal(restored, values)


def test_files_of_a_written_image(tmp_path):
    path = write_image(tmp_path / "a.png", painted(3))
    picture = Picture(path, "a", 0.0)
    write_picture(tmp_path / "pictures", picture)
    data, stored = unpacked((tmp_path / "pictures" / f"{picture.identity}.js").read_text())
    np.testing.assert_array_equal(stored, painted(3))
    assert (data["width"], data["height"], data["display"], data["reading"]) == (16, 9, True, "")
    small = read_image(tmp_path / "pictures" / f"{picture.identity}.jpg")
    assert (small.width, small.height) == (16, 9)
    seen = np.stack([small.channels[name] for name in "RGB"], axis=-1)
    assert np.abs(seen * 255 - painted(3)).mean() < 3

    # what exists is not made again
    small_file = tmp_path / "pictures" / f"{picture.identity}.jpg"
    small_file.write_bytes(b"mine")
    path.unlink()
    write_picture(tmp_path / "pictures", picture)
    assert small_file.read_bytes() == b"mine"


def test_large_pictures_are_reduced_by_a_whole_number(tmp_path, monkeypatch):
    values = np.random.default_rng(2).random((40, 61, 3)).astype(np.float32)
    small = reduced(values, 3)
    assert small.shape == (14, 21, 3)
    np.testing.assert_allclose(small[0, 0], values[:3, :3].mean(axis=(0, 1)), rtol=1e-6)
    np.testing.assert_allclose(small[13, 20], values[39:, 60:].mean(axis=(0, 1)), rtol=1e-6)
    monkeypatch.setattr(picture_files, "MAX_PIXELS", 300)
    data, stored = unpacked(pixels_script(Picture(tmp_path, "a", 0.0), Colors(values, False, {})))
    assert data["reduced"] == 3
    np.testing.assert_array_equal(stored, small)
    assert max(thumbnail(Colors(np.ones((10, 1000, 1), np.float32), True, {}), 0.0).shape[:2]) == 334


def test_light_is_exposed_in_thumbnails():
    light = Colors(np.full((2, 2, 3), 0.25, np.float32), False, {})
    assert thumbnail(light, 2.0)[0, 0, 0] == 255
    assert thumbnail(light, 0.0)[0, 0, 0] == 137  # the sRGB curve at 0.25


def test_numbers_of_data_say_what_they_mean(tmp_path, illum):
    scene = tmp_path / "a.yaml"
    film = "film: {width: 8, height: 6, samples: 1}"
    scene.write_text(f"version: 1\n{film}\nobjects: [{{mesh: {{shape: sphere}}}}]\n")
    assert illum("render", scene, "--only", "depth", "-o", "d.png").returncode == 0
    colors = read_colors(tmp_path / "d.png")
    data, _ = unpacked(pixels_script(Picture(tmp_path / "d.png", "a", 0.0), colors))
    assert re.fullmatch(r"depth = [\d.]+ \* \(1 / v - 1\); 0 where nothing is seen", data["reading"])


def test_the_identity_depends_on_content_and_exposure(tmp_path):
    first, other = Picture(tmp_path / "a", "a", 0.0), Picture(tmp_path, "b", 0.0)
    assert first.identity == Picture(tmp_path / "b", "a", 0.0).identity
    assert len({each.identity for each in (first, other, Picture(tmp_path, "a", 1.0))}) == 3
