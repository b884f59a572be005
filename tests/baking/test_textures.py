"""Bakes of textures, from the command to the files."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from gltf_validator import faults
from illumcli import memory
from illumcli.baking import unwrapped as unwrapped_module
from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.cli import illum
from illumcli.errors import InputError, LimitError
from illumcli.images.png import read_texts
from illumcli.images.reader import read_image, read_metadata
from illumcli.mesh_files import embedded_image, read_mesh
from illumcli.mesh_files.gltf.accessors import table
from illumcli.mesh_files.gltf.document import open_document

SETTINGS = BakeSettings(texture=(16, 16), samples=16)

# a floor and a wall at its edge x = 1, charts side by side
CORNER = """\
v 0 0 0
v 1 0 0
v 1 0 -1
v 0 0 -1
v 1 1 0
v 1 1 -1
vt 0.1 0.2
vt 0.4 0.2
vt 0.4 0.8
vt 0.1 0.8
vt 0.6 0.2
vt 0.9 0.2
vt 0.9 0.8
vt 0.6 0.8
f 1/1 2/2 3/3 4/4
f 2/5 5/6 6/7 3/8
"""


@pytest.fixture
def text_mesh(tmp_path):
    def make(text):
        path = tmp_path / "mesh.obj"
        path.write_text(text)
        return path

    return make


def bake(path, out, settings=SETTINGS, **options):
    return bake_mesh(path, [out], settings, BakeOptions(**options))


def texels(path):
    """(H, W) obscurance; row 0 is the top."""
    return read_image(path).channels["Y"]


def column(u, v=0.5, size=16):
    return int((1 - v) * size), int(u * size)


def test_texels_beside_a_wall_are_darker_and_gutters_are_filled(text_mesh, tmp_path):
    out = tmp_path / "a.png"
    _, report = bake(text_mesh(CORNER), out, BakeSettings(texture=(32, 32), samples=256))
    w = texels(out)
    # u = 0.39 is the floor beside the wall: half is hidden
    assert w[column(0.39, size=32)] == pytest.approx(0.5, abs=0.1)
    assert w[column(0.12, size=32)] > 0.8
    # gutters have values of charts, from 0.5 on
    assert w.min() > 0.35
    assert not report.warnings
    assert report.textures[0]["texels"] > 0


def test_texels_agree_with_vertices(text_mesh, tmp_path):
    path = text_mesh(CORNER)
    settings = BakeSettings(texture=(64, 64), samples=1024)
    bake(path, tmp_path / "a.exr", settings)
    w = texels(tmp_path / "a.exr")
    _, _ = bake_mesh(path, [tmp_path / "a.npz"], BakeSettings(samples=1024))
    at_vertices = np.load(tmp_path / "a.npz")["corner_obscurance"][:4]
    # v upwards: the floor's first corner is at the lower left of its chart
    for (u, v), value in zip(((0.1, 0.2), (0.4, 0.2), (0.4, 0.8), (0.1, 0.8)), at_vertices, strict=True):
        inside = 0.25 + (u - 0.25) * 0.97, 0.5 + (v - 0.5) * 0.97
        # w is steep at the ends of the wall
        assert w[column(*inside, size=64)] == pytest.approx(value, abs=0.02 if u < 0.2 else 0.1)


def test_a_glb_has_the_texture_of_its_uv(text_mesh, tmp_path):
    source = text_mesh(CORNER)
    bake(source, tmp_path / "a.glb", BakeSettings(texture=(64, 64), samples=256))
    bake(tmp_path / "a.glb", tmp_path / "b.glb", BakeSettings(texture=(64, 64), samples=256))
    for path in (tmp_path / "a.glb", tmp_path / "b.glb"):  # new, and extended
        document = open_document(path)
        (tmp_path / "map.png").write_bytes(embedded_image(path, 0))
        w = texels(tmp_path / "map.png")
        primitive = document.json["meshes"][0]["primitives"][0]
        uv = table(document, primitive["attributes"]["TEXCOORD_0"], (2,))  # v downwards, as rows
        at_vertices = table(document, primitive["attributes"]["_OBSCURANCE"], (1,))[:, 0]
        inside = uv[:4].mean(axis=0) + 0.97 * (uv[:4] - uv[:4].mean(axis=0))
        column, row = (64 * inside).astype(int).T
        np.testing.assert_allclose(w[row, column], at_vertices[:4], atol=0.1)
        assert "occlusionTexture" in document.json["materials"][primitive["material"]]
        assert faults(path) == []


def test_files_say_what_they_are(text_mesh, tmp_path):
    path = text_mesh(CORNER)
    bake(path, tmp_path / "a.png")
    texts = read_texts(tmp_path / "a.png")
    assert texts["illum:encoding"] == "linear"
    assert json.loads(texts["illum:about"])["parameters"]["texture"] == [16, 16]
    bake(path, tmp_path / "a.exr")
    assert read_metadata(tmp_path / "a.exr")["illum:encoding"] == "linear"


def test_exr_has_the_error_map_and_the_coverage(text_mesh, tmp_path):
    out = tmp_path / "a.exr"
    bake(text_mesh(CORNER), out)
    channels = read_image(out).channels
    assert set(channels) == {"Y", "coverage.Y", "error.Y"}
    assert 0 < channels["coverage.Y"].mean() < 1
    assert channels["error.Y"].max() > 0


def test_16_bits_round_finer(text_mesh, tmp_path):
    path = text_mesh(CORNER)
    bake(path, tmp_path / "8.png")
    bake(path, tmp_path / "16.png", BakeSettings(texture=(16, 16), samples=16, bits=16))
    bake(path, tmp_path / "a.exr")
    exact = texels(tmp_path / "a.exr")
    assert np.abs(texels(tmp_path / "8.png") - exact).max() < 0.51 / 255
    assert np.abs(texels(tmp_path / "16.png") - exact).max() < 0.51 / 65535


def test_values_depend_on_no_thread_count(text_mesh, tmp_path):
    path = text_mesh(CORNER)
    settings = BakeSettings(texture=(48, 48), target_error=0.02, reconstruct=True)
    bake(path, tmp_path / "1.exr", settings, threads=1)
    bake(path, tmp_path / "3.exr", settings, threads=3)
    one, three = (read_image(tmp_path / name).channels for name in ("1.exr", "3.exr"))
    for name in one:
        np.testing.assert_array_equal(one[name], three[name])


def test_overlapping_uv_have_the_mean_and_are_told(text_mesh, tmp_path):
    # the wall's chart moved onto the floor's, and there mirrored
    moved = CORNER.replace("f 2/5 5/6 6/7 3/8", "f 2/1 5/2 6/3 3/4")
    _, report = bake(text_mesh(moved), tmp_path / "a.exr", BakeSettings(texture=(32, 32), samples=256))
    assert any("belong to several places of the surface" in line for line in report.warnings)
    assert report.textures[0]["overlapping_mirrored"] == 0
    mirrored = CORNER.replace("f 2/5 5/6 6/7 3/8", "f 2/2 5/1 6/4 3/3")
    out = tmp_path / "b.exr"
    _, report = bake(text_mesh(mirrored), out, BakeSettings(texture=(32, 32), samples=256))
    facts = report.textures[0]
    assert facts["overlapping"] == facts["overlapping_mirrored"] > 100
    assert any("to mirrored charts" in line for line in report.warnings)
    # beside the edge both are half hidden, far from it both are open
    assert texels(out)[column(0.39, size=32)] == pytest.approx(0.5, abs=0.1)


def test_each_material_has_a_texture(text_mesh, tmp_path):
    path = text_mesh(CORNER.replace("f 1/1", "usemtl red\nf 1/1").replace("f 2/5", "usemtl blue\nf 2/5"))
    with pytest.raises(InputError, match=r"as in .*a\.\{material\}\.png"):
        bake(path, tmp_path / "a.png")
    paths, _ = bake(path, tmp_path / "{material}.png")
    assert [each.name for each in paths] == ["red.png", "blue.png"]
    # the charts of the other material are no part of it
    assert texels(tmp_path / "blue.png").min() > 0.4


def test_the_command_names_textures_by_material(text_mesh, tmp_path):
    path = text_mesh(CORNER.replace("f 1/1", "usemtl red\nf 1/1").replace("f 2/5", "usemtl blue\nf 2/5"))
    pattern = str(tmp_path / "{name}.{material}.ao.png")
    arguments = ["ao-bake", str(path), "--texture", "16x8", "--samples", "4", "-o", pattern]
    done = CliRunner().invoke(illum, arguments)
    assert done.exit_code == 0, done.output
    names = sorted(each.name for each in tmp_path.glob("*.png"))
    assert names == [f"{path.stem}.blue.ao.png", f"{path.stem}.red.ao.png"]
    assert texels(tmp_path / names[0]).shape == (8, 16)
    assert "kept, its content is the same" in CliRunner().invoke(illum, arguments).output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "x.png"], "give its size, as in --texture 1024"),
        (["-o", "x.npz", "--texture", "64"], "--texture belongs to"),
        (["-o", "x.png", "--texture", "0"], "is no size"),
        (["-o", "x.glb", "--texture", "8", "--what", "bent_normal"], "the textures of a GLB hold ao"),
    ],
)
def test_options_that_do_not_fit_are_refused(text_mesh, arguments, said):
    done = CliRunner().invoke(illum, ["ao-bake", str(text_mesh(CORNER)), *arguments])
    assert done.exit_code != 0
    assert said in done.output + str(done.exception)


def test_uv_that_repeat_too_often_are_refused(text_mesh, tmp_path):
    often = CORNER.replace("vt 0.9 0.2", "vt 900 0.2").replace("vt 0.9 0.8", "vt 900 0.8")
    with pytest.raises(InputError, match=r"cover the texture 540 times.*--unwrap all"):
        bake(text_mesh(often), tmp_path / "a.png")


def test_textures_beyond_the_memory_are_refused_at_once(text_mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 1 << 20)
    with pytest.raises(LimitError, match=r"texels: takes about .*choose a smaller --texture"):
        bake(text_mesh(CORNER), tmp_path / "a.png", BakeSettings(texture=(2048, 2048)))


def test_polygons_without_uv_are_told_with_the_way_out(text_mesh, tmp_path):
    path = text_mesh(CORNER.replace("f 2/5 5/6 6/7 3/8", "f 2 5 6 3"))
    warnings = bake(path, tmp_path / "a.png")[1].warnings
    assert "mesh: 2 triangles have no uv: no texel belongs to them; --unwrap all makes uv for all" in warnings


def test_meshes_without_uv_are_refused(text_mesh, tmp_path):
    path = text_mesh("v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n")
    with pytest.raises(InputError, match="has no uv"):
        bake(path, tmp_path / "a.png")


def test_uv_are_made_where_there_are_none_and_kept_for_the_next_bake(text_mesh, tmp_path, monkeypatch):
    pytest.importorskip("xatlas")
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "cache"))
    plain = "".join(line for line in CORNER.splitlines(keepends=True) if not line.startswith("vt"))
    path = text_mesh(
        plain.replace("/1", "")
        .replace("/2", "")
        .replace("/3", "")
        .replace("/4", "")
        .replace("/5", "")
        .replace("/6", "")
        .replace("/7", "")
        .replace("/8", "")
    )
    settings = BakeSettings(texture=(32, 32), samples=64, unwrap="missing")
    with pytest.raises(InputError, match="--unwrap missing makes them"):
        bake(path, tmp_path / "a.png")
    bake(path, tmp_path / "a.exr", settings)
    channels = read_image(tmp_path / "a.exr").channels
    assert 0.4 < channels["Y"].min() < 0.6
    assert channels["coverage.Y"].mean() > 0.3

    def fail(*_):
        raise AssertionError("made again")

    monkeypatch.setattr(unwrapped_module, "unwrapped", fail)
    bake(path, tmp_path / "b.exr", settings)
    np.testing.assert_array_equal(read_image(tmp_path / "b.exr").channels["Y"], channels["Y"])


def test_uv_that_overlap_are_replaced_on_request(text_mesh, tmp_path):
    pytest.importorskip("xatlas")
    overlapping = text_mesh(CORNER.replace("f 2/5 5/6 6/7 3/8", "f 2/1 5/2 6/3 3/4"))
    settings = BakeSettings(texture=(32, 32), samples=16, unwrap="all")
    _, report = bake(overlapping, tmp_path / "a.png", settings)
    assert not report.warnings


def test_a_glb_has_uv_that_cut_polygons(tmp_path):
    pytest.importorskip("xatlas")
    # a folded quad: xatlas may cut it along its diagonal, so its triangles have corners of their own
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 3 -1\nv 0 0 -1\nf 1 2 3 4\n")
    bake(path, tmp_path / "a.glb", BakeSettings(texture=(32, 32), samples=16, unwrap="missing"))
    mesh = read_mesh(tmp_path / "a.glb")
    assert mesh.uvs is not None
    assert len(mesh.corners) == 6
    corners = mesh.uvs[mesh.corner_uvs].reshape(2, 3, 2)
    (ax, ay), (bx, by) = (corners[:, k].T - corners[:, 0].T for k in (1, 2))
    assert (ax * by - ay * bx > 0.01).all()


def test_a_changed_uv_is_another_texture(text_mesh, tmp_path):
    path = text_mesh(CORNER)
    out = tmp_path / "a.png"
    bake(path, out)
    assert bake(path, out)[1].kept == [str(out)]
    path.write_text(CORNER.replace("vt 0.9 0.2", "vt 0.8 0.2"))
    assert bake(path, out, force=True)[1].written == [str(out)]


# ------------------------------------------------------------------ bent normals and thickness

EVERYTHING = ("ao", "bent_normal", "thickness")


def test_an_exr_has_every_channel_and_a_png_one(text_mesh, tmp_path):
    path = text_mesh(CORNER)
    falloff = {"falloff": "step", "max_distance": 0.5}
    settings = BakeSettings(texture=(32, 32), samples=64, what=EVERYTHING, bits=16, falloff=falloff)
    bake(path, tmp_path / "a.exr", settings)
    exr = read_image(tmp_path / "a.exr").channels
    names = {"Y", "error.Y", "coverage.Y", "thickness.Y", "thickness_error.Y"}
    assert set(exr) == names | {f"bent_normal.{axis}" for axis in "XYZ"}
    bake(path, tmp_path / "a.{what}.png", settings)
    png = {word: read_image(tmp_path / f"a.{word}.png").channels for word in EVERYTHING}
    np.testing.assert_allclose(png["ao"]["Y"], exr["Y"], atol=1e-5)
    np.testing.assert_allclose(0.5 * png["thickness"]["Y"], exr["thickness.Y"], atol=1e-5)
    for name, axis in zip("RGB", "XYZ", strict=True):
        np.testing.assert_allclose(2 * png["bent_normal"][name] - 1, exr[f"bent_normal.{axis}"], atol=2e-5)
    assert read_texts(tmp_path / "a.thickness.png")["illum:limit"] == "0.5"


def test_pngs_of_several_words_need_names(text_mesh, tmp_path):
    said = r"a\.png: a PNG holds one of ao, thickness; .* as in .*a\.\{what\}\.png"
    with pytest.raises(InputError, match=said):
        bake(text_mesh(CORNER), tmp_path / "a.png", replace(SETTINGS, what=("ao", "thickness")))
    bake(text_mesh(CORNER), tmp_path / "b.png", replace(SETTINGS, what=("thickness",)))
    assert texels(tmp_path / "b.png").max() == 1  # sheets have no thickness: the limit


CHARTS = {
    "u along x": ("1/1 2/2 3/3 4/4", (-1, 0)),
    "u against x": ("1/2 2/1 3/4 4/3", (1, 0)),  # mirrored
    "v along x": ("1/2 2/3 3/4 4/1", (0, -1)),
    "v along x, mirrored": ("1/1 2/4 3/3 4/2", (0, -1)),
}


@pytest.mark.parametrize("chart", CHARTS)
def test_bent_normals_are_in_tangent_space(text_mesh, tmp_path, chart):
    """A wall at x = 1 bends the normals of the floor towards -x."""
    corners, away = CHARTS[chart]
    settings = BakeSettings(texture=(64, 64), samples=256, what=("ao", "bent_normal"))
    bake(text_mesh(CORNER.replace("1/1 2/2 3/3 4/4", corners)), tmp_path / "a.exr", settings)
    exr = read_image(tmp_path / "a.exr").channels
    x, y, z = (exr[f"bent_normal.{axis}"] for axis in "XYZ")
    np.testing.assert_allclose(x * x + y * y + z * z, 1, atol=1e-5)
    floor = np.s_[14:50, 8:24]
    assert z[floor].min() > 0
    lean = np.array([x[floor].mean(), y[floor].mean()])
    assert lean @ away > 0.1
    assert abs(lean @ away[::-1]) < 0.03
