"""Images as bytes, for other files to hold."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from illumcli.images.encoded import encoded_image, png_bytes
from illumcli.images.jpeg import write_jpeg
from illumcli.images.reader import read_image
from illumcli.images.writer import ImageWriter

PIXELS = np.arange(24, dtype=np.uint8).reshape(2, 4, 3) * 10


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG."""
    return len(data).to_bytes(4) + kind + data + zlib.crc32(kind + data).to_bytes(4)


def test_a_png_loses_only_its_colour_profile(tmp_path: Path) -> None:
    plain = png_bytes(PIXELS, srgb=False)
    profile = chunk(b"gAMA", b"\0\0\xb1\x8f") + chunk(b"iCCP", b"x\0\0" + zlib.compress(b"profile"))
    (tmp_path / "a.png").write_bytes(plain[:33] + profile + plain[33:])
    assert encoded_image(str(tmp_path / "a.png")) == (plain, "image/png")


def test_a_jpeg_is_embedded_as_it_is(tmp_path: Path) -> None:
    write_jpeg(tmp_path / "a.jpg", PIXELS)
    assert encoded_image(str(tmp_path / "a.jpg")) == ((tmp_path / "a.jpg").read_bytes(), "image/jpeg")


def test_other_images_become_png_of_display_values(tmp_path: Path) -> None:
    with ImageWriter(tmp_path / "a.exr", 4, 2, dict.fromkeys("RGBA", "float")) as writer:
        writer.write_band(0, np.full((2, 4, 4), [0.125, 0.125, 0.125, 0.5], np.float32))
        writer.close()
    data, kind = encoded_image(str(tmp_path / "a.exr"))
    (tmp_path / "b.png").write_bytes(data)
    made = read_image(tmp_path / "b.png")
    assert kind == "image/png"
    assert made.encoded
    np.testing.assert_allclose(made.channels["G"], 137 / 255)
    np.testing.assert_allclose(made.channels["A"], 128 / 255)
