"""The hash in a file reveals every changed bit and every truncation."""

from __future__ import annotations

import random

import numpy as np
import pytest

from illumcli.baking.files import write_baked_glb, write_baked_ply
from illumcli.files.reports import sealed_csv, sealed_json
from illumcli.files.seal import BLANK, is_sealed, sealed_text
from illumcli.images.writer import ImageWriter
from illumcli.mesh_files.output_mesh import OutputMesh
from illumcli.visibility.baked import Baked, write_npz

FORMATS = ("half.exr", "mixed.exr", "8.png", "16.png", "npz", "ply", "glb", "csv", "json", "svg")


def write(path, rows=5, seed=0):
    draw = np.random.default_rng(seed)
    if path.suffix in (".exr", ".png"):
        kinds = {"half": "RGB:half", "mixed": "RGBY:float", "8": "RGB:uint8", "16": "Y:uint16"}
        names, _, kind = kinds[path.stem].partition(":")
        channels = dict.fromkeys(names, kind)
        band = draw.integers(0, 200, (rows, 40, len(names))).astype(
            {"uint8": np.uint8, "uint16": np.uint16}.get(kind, np.float32)
        )
        if path.stem == "mixed":
            channels["Y"] = "uint"
        with ImageWriter(path, 40, rows, channels, {"illum:content": "abc"}) as image:
            image.write_band(0, band)
        return path
    if path.suffix in (".csv", ".json", ".svg"):
        found = [{"content": f"{number:x}", "seconds": number / 7} for number in range(rows)]
        text = {
            ".csv": lambda: sealed_csv(["content", "seconds"], [tuple(each.values()) for each in found]),
            ".json": lambda: sealed_json(found, in_a_list=rows > 1),
            ".svg": lambda: sealed_text(f"<svg><li>{BLANK}</li>{found}</svg>"),
        }
        path.write_text(text[path.suffix]())
        return path
    corners, starts = np.array([0, 1, 2], np.int32), np.array([0, 3], np.int32)
    vertices = draw.random((3 * rows, 3))
    shape = OutputMesh("a", vertices, corners, starts, corners.reshape(1, 3), {})
    w = draw.random(3 * rows).astype(np.float32)
    baked = Baked({"obscurance": w, "standard_error": w}, {"content": "abc"})
    match path.suffix:
        case ".npz":
            write_npz(path, baked)
        case ".ply":
            write_baked_ply(path, [shape], baked, None, None)
        case ".glb":
            write_baked_glb(path, [shape], baked, None)
    return path


def named(folder, kind):
    return folder / (kind if "." in kind else f"a.{kind}")


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("rows", [1, 5, 30000])
def test_what_is_written_is_sealed_and_equal_data_are_equal_files(tmp_path, kind, rows):
    (tmp_path / "again").mkdir()
    first, again = write(named(tmp_path, kind), rows), write(named(tmp_path / "again", kind), rows)
    assert is_sealed(first)
    assert first.read_bytes() == again.read_bytes()


@pytest.mark.parametrize("kind", FORMATS)
def test_every_changed_bit_and_every_cut_is_told(tmp_path, kind):
    path = write(named(tmp_path, kind))
    whole, draw = path.read_bytes(), random.Random(1)
    for at in range(len(whole)):
        data = bytearray(whole)
        data[at] ^= 1 << draw.randrange(8)
        path.write_bytes(data)
        assert not is_sealed(path), at
    for end in range(len(whole)):
        path.write_bytes(whole[:end])
        assert not is_sealed(path), end
    path.write_bytes(whole + b"\0")
    assert not is_sealed(path)
