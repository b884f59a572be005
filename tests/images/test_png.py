"""PNG files as the standard has them: chunks, filter, text; the same bytes for any bands."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest

from illumcli.images.png import read_texts
from illumcli.images.reader import read_image, read_metadata
from illumcli.images.writer import ImageWriter


def write(path, pixels, rows=None, metadata=None, names="RGB"):
    height, width, _ = pixels.shape
    with ImageWriter(path, width, height, dict.fromkeys(names, pixels.dtype.name), metadata) as writer:
        for y in range(0, height, rows or height):
            writer.write_band(y, pixels[y : y + (rows or height)])


def chunks(path):
    """(kind, data) of every chunk, each of which keeps its promise."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, found = 8, []
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + size]
        assert struct.unpack_from(">I", data, at + 8 + size) == (zlib.crc32(kind + body),)
        found.append((kind, body))
        at += 12 + size
    assert at == len(data)
    return found


def test_plain_numbers_name_no_curve(tmp_path):
    with ImageWriter(tmp_path / "a.png", 2, 1, {"Y": "uint8"}, srgb=False) as writer:
        writer.write_band(0, np.array([[[1], [2]]], np.uint8))
    assert [kind for kind, _ in chunks(tmp_path / "a.png")] == [b"IHDR", b"IDAT", b"tEXt", b"IEND"]
    with ImageWriter(tmp_path / "b.exr", 2, 1, {"Y": "float"}, srgb=False) as writer:
        writer.write_band(0, np.zeros((1, 2, 1), np.float32))


def noise(height, width, channels=3, dtype=np.uint8):
    top = np.iinfo(dtype).max
    return np.random.default_rng(4).integers(0, top, (height, width, channels), dtype, endpoint=True)


@pytest.mark.parametrize(("names", "kind"), [("Y", 0), ("RGB", 2), ("YA", 4), ("RGBA", 6)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_decoder_of_ten_lines_reads_it(tmp_path, names, kind, dtype):
    pixels = noise(5, 9, len(names), dtype)
    write(tmp_path / "a.png", pixels, names=names)
    found = chunks(tmp_path / "a.png")
    kinds = list(dict.fromkeys(kind for kind, _ in found))
    assert kinds == [b"IHDR", b"sRGB", b"gAMA", b"IDAT", b"tEXt", b"IEND"]
    assert found[1:3] == [(b"sRGB", b"\0"), (b"gAMA", (45455).to_bytes(4))]
    assert found[0][1] == struct.pack(">IIBBBBB", 9, 5, pixels.itemsize * 8, kind, 0, 0, 0)
    lines = zlib.decompress(b"".join(data for kind, data in found if kind == b"IDAT"))
    lines = np.frombuffer(lines, np.uint8).reshape(5, -1)
    assert (lines[:, 0] == 1).all()  # Sub
    step = pixels.itemsize * len(names)
    values = lines[:, 1:].reshape(5, 9, step).cumsum(axis=1, dtype=np.uint8)
    np.testing.assert_array_equal(
        values.reshape(5, -1), pixels.astype(f">u{pixels.itemsize}").reshape(5, -1).view(np.uint8)
    )


@pytest.mark.parametrize("rows", [1, 7, 64, 150])
def test_large_pictures_have_the_same_bytes_whatever_their_bands(tmp_path, rows):
    pixels = noise(211, 400)
    pixels[:, 100:300] //= 64  # some that compresses
    write(tmp_path / "whole.png", pixels)
    write(tmp_path / "bands.png", pixels, rows)
    assert (tmp_path / "whole.png").read_bytes() == (tmp_path / "bands.png").read_bytes()
    image = read_image(tmp_path / "bands.png")
    np.testing.assert_array_equal(np.rint(image.channels["G"] * 255), pixels[..., 1])


def test_text_beyond_ascii_is_kept(tmp_path):
    given = {"Software": "illum", "illum:camera": "Küche", "illum:layers": "光,key", "illum:eye": (1, 2.5)}
    write(tmp_path / "a.png", noise(3, 3), metadata=given)
    found = read_metadata(tmp_path / "a.png")
    assert [found[name] for name in given] == ["illum", "Küche", "光,key", "1 2.5"]
    kinds = [kind for kind, _ in chunks(tmp_path / "a.png") if kind in (b"tEXt", b"iTXt")]
    assert kinds == [b"tEXt", b"iTXt", b"iTXt", b"tEXt", b"tEXt"]  # the last is the hash


def test_a_picture_is_written_without_the_library_of_the_others(tmp_path):
    code = (
        "import sys, numpy as np; from illumcli.images.writer import ImageWriter\n"
        "with ImageWriter(sys.argv[1], 4, 4, {'Y': 'uint8'}) as out:\n"
        "    out.write_band(0, np.zeros((4, 4, 1), np.uint8))\n"
        "sys.exit('OpenImageIO' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code, tmp_path / "a.png"], check=True)
    assert read_image(tmp_path / "a.png").width == 4


def test_texts_are_read_without_the_library_and_only_of_sound_files(tmp_path):
    path = tmp_path / "a.png"
    with ImageWriter(path, 2, 2, {"Y": "uint8"}, {"illum:content": "one", "seed": 7}) as writer:
        writer.write_band(0, np.zeros((2, 2, 1), np.uint8))
    texts = read_texts(path)
    assert {name: texts[name] for name in ("illum:content", "seed")} == {"illum:content": "one", "seed": "7"}
    data = path.read_bytes()
    cut = "end is missing"
    for size, fact in ((0, "no PNG"), (7, "no PNG"), (8, cut), (len(data) - 9, cut)):
        path.write_bytes(data[:size])
        with pytest.raises(ValueError, match=fact):
            read_texts(path)
