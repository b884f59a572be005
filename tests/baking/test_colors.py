"""`--color`: what a bake does to the colours of vertices, and that it does no more."""

from __future__ import annotations

import numpy as np
import pytest
from plyfile import PlyData

from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.color import from_srgb, to_srgb
from illumcli.errors import InputError
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf.document import open_document

STEP = [(-1, 0, -3), (1, 0, -3), (1, 0, 0), (-1, 0, 0), (1, 1, 0), (-1, 1, 0)]
BYTES = np.array([[255, 0, 0], [0, 128, 255], [9, 9, 9], [200, 100, 50], [1, 2, 3], [255, 255, 255]])


def ply(path, kind="uchar", colors=BYTES, more=""):
    """A floor with a wall, whose vertices have colours of a type; with `more` an alpha of a half."""
    rows = [
        " ".join(map(str, (*at, *color, *([0.5 if more == "float" else 128] if more else []))))
        for at, color in zip(STEP, colors.tolist(), strict=True)
    ]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    lines += [f"property float {name}" for name in "xyz"]
    lines += [f"property {kind} {name}" for name in ("red", "green", "blue")]
    lines += [f"property {more} alpha"] * bool(more)
    lines += ["element face 2", "property list uchar int vertex_index", "end_header"]
    path.write_text("\n".join([*lines, *rows, "4 3 2 1 0", "4 3 5 4 2"]))
    return path


def bake(source, out, **settings):
    """The report of a bake, and the obscurance in its file."""
    options = BakeOptions(threads=1, force=True)
    _, report = bake_mesh(source, [out], BakeSettings(samples=64, **settings), options)
    attributes = read_mesh(out).attributes
    return report, np.asarray(attributes.get("obscurance", attributes.get("_OBSCURANCE")), float)


def colors_of(path, *names):
    vertex = PlyData.read(path)["vertex"]
    return np.stack([vertex[name] for name in names or ("red", "green", "blue")], axis=1)


# ------------------------------------------------------------------ PLY


def test_without_the_option_colours_stay(tmp_path):
    report, _ = bake(ply(tmp_path / "in.ply"), tmp_path / "out.ply")
    assert np.array_equal(colors_of(tmp_path / "out.ply"), BYTES)
    assert report.warnings == []


def test_multiply_dims_the_colours_that_are_there(tmp_path):
    report, w = bake(ply(tmp_path / "in.ply"), tmp_path / "out.ply", color="multiply")
    dimmed = np.rint(255 * to_srgb(from_srgb(BYTES / 255.0) * w[:, None]))
    written = colors_of(tmp_path / "out.ply")
    assert written.dtype == np.uint8
    assert np.abs(written - dimmed).max() <= 1  # colours are read in single precision
    assert (written[w < 0.9] < BYTES[w < 0.9]).any()
    assert report.warnings == []


def test_replace_paints_over_the_colours_and_says_so(tmp_path):
    report, w = bake(ply(tmp_path / "in.ply", more="float"), tmp_path / "out.ply", color="replace")
    grey = np.rint(255 * to_srgb(w))
    assert np.array_equal(colors_of(tmp_path / "out.ply"), np.tile(grey[:, None], 3))
    assert (PlyData.read(tmp_path / "out.ply")["vertex"]["alpha"] == 0.5).all()
    assert report.warnings == ["--color replace: replaces red, green, blue of the vertex colours of mesh"]


@pytest.mark.parametrize(("name", "channel", "said"), [("g", "green", "green"), ("a", "alpha", "alpha")])
def test_a_channel_takes_the_plain_numbers_and_says_so(tmp_path, name, channel, said):
    report, w = bake(ply(tmp_path / "in.ply", more="uchar"), tmp_path / "out.ply", color=name)
    others = {"red": 0, "green": 1, "blue": 2}
    assert np.array_equal(colors_of(tmp_path / "out.ply", channel)[:, 0], np.rint(255 * w))
    for other in others.keys() - {channel}:
        assert np.array_equal(colors_of(tmp_path / "out.ply", other)[:, 0], BYTES[:, others[other]])
    assert report.warnings == [f"--color {name}: replaces {said} of the vertex colours of mesh"]


@pytest.mark.parametrize(
    ("kind", "colors", "expected"),
    [("ushort", BYTES * 257, np.uint16), ("float", BYTES / 255, np.float32), ("int", BYTES, np.uint8)],
)
def test_colours_keep_the_precision_of_their_type(tmp_path, kind, colors, expected):
    _, w = bake(ply(tmp_path / "in.ply", kind, colors), tmp_path / "out.ply", color="multiply")
    written = colors_of(tmp_path / "out.ply")
    largest = 1 if expected == np.float32 else np.iinfo(expected).max
    linear = BYTES / 255 if kind == "float" else from_srgb(BYTES / 255.0)
    dimmed = linear * w[:, None] if kind == "float" else to_srgb(linear * w[:, None])
    assert written.dtype == expected
    np.testing.assert_allclose(written / largest, dimmed, atol=1e-6 + 1 / largest if largest > 1 else 1e-6)


# ------------------------------------------------------------------ GLB


def test_a_glb_of_another_format_has_its_colours_with_the_change(tmp_path):
    _, w = bake(ply(tmp_path / "in.ply", more="float"), tmp_path / "out.glb", color="multiply")
    written = read_mesh(tmp_path / "out.glb")
    before = read_mesh(tmp_path / "in.ply")
    number = [int(np.argmin(np.linalg.norm(before.vertices - each, axis=1))) for each in written.vertices]
    expected = before.attributes["color"][number] * w[:, None]
    np.testing.assert_allclose(written.attributes["color"], expected, atol=1e-6)
    assert (written.attributes["alpha"] == 0.5).all()
    document = open_document(tmp_path / "out.glb").json
    (primitive,) = document["meshes"][0]["primitives"]
    assert (
        len(document["accessors"]) == len(primitive["attributes"]) + 1
    )  # none is left of the colours before


def test_a_glb_keeps_the_type_of_its_colours(tmp_path):
    bake(ply(tmp_path / "in.ply"), tmp_path / "float.glb")
    for color in ("multiply", "replace"):
        report, w = bake(tmp_path / "float.glb", tmp_path / f"{color}.glb", color=color)
        before = read_mesh(tmp_path / "float.glb").attributes["color"]
        expected = before * w[:, None] if color == "multiply" else np.tile(w[:, None], 3)
        written = read_mesh(tmp_path / f"{color}.glb").attributes["color"]
        np.testing.assert_allclose(written, expected, rtol=1e-6)
        assert len(report.warnings) == (color == "replace")


# ------------------------------------------------------------------ contradictions


@pytest.mark.parametrize(
    ("out", "settings", "said"),
    [
        ("out.npz", {}, "--color r: belongs to outputs with colours, "),
        ("out.ply", {"what": ("thickness",)}, "--color r: writes ao; add it to --what"),
    ],
)
def test_a_change_of_nothing_is_refused(tmp_path, out, settings, said):
    with pytest.raises(InputError, match=said):
        bake(ply(tmp_path / "in.ply"), tmp_path / out, color="r", **settings)
