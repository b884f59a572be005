"""Obscurance of meshes from files: vertex values of every format, and textures."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest

from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeSettings
from illumcli.errors import InputError
from illumcli.geometry.repairs import NO_OCCLUSION
from illumcli.mesh_files import holds_obscurance
from illumcli.render_graph.build import build
from illumcli.render_graph.repairs import repairs_of
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.load import load
from metamorphic.pictures import pictures
from painted import write_picture

ROOM = """v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nv 0 1 0\nv 2 1 0\nv 0.9 0 0.9\nv 1.3 0 0.9\nv 1.1 0 1.3
v 1.1 0.5 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
f 1/1 4/2 3/3 2/4\nf 1/1 2/2 6/3 5/4\nf 7/1 10/2 8/3\nf 8/1 10/2 9/3\nf 9/1 10/2 7/3
"""
SCENE = """
version: 1
film: {width: 64, height: 40, samples: 1}
camera: {position: [0.6, 1.8, 4], target: [0.2, 0.2, 0]}
ambient: 1
meshes:
  room: {file: room.obj, obscurance: FILE}
objects:
- {name: one, mesh: room, transform: {translate: [-1, 0, 0]}}
- {name: turned, mesh: room, transform: {translate: [1.2, 0, -2], scale: [0.7, 0.9, -0.7]}}
outputs: {layers: [obscurance]}
"""
SPLIT = BakeSettings(samples=16, split=True)


@pytest.fixture
def path(tmp_path):
    """A scene whose objects share a mesh with a hard edge, quads and triangles."""
    (tmp_path / "room.obj").write_text(ROOM)
    return tmp_path / "scene.yaml"


def obscurance(path, file):
    """(H, W, 1) w of the scene with a file, as a command in the folder above the scene's has it."""
    path.write_text(SCENE.replace(", obscurance: FILE", f", obscurance: {file}" if file else ""))
    with contextlib.chdir(path.parents[1]):
        ((_, values),) = pictures(Path(path.parent.name, path.name), (), ("obscurance",)).items()
    return np.where(values > 0, values, np.nan)  # NaN where nothing is


@pytest.mark.parametrize("source", ["room.obj", "scene.yaml"])
def test_all_formats_show_the_same(path, source):
    path.write_text(SCENE.replace(", obscurance: FILE", ""))
    outputs = [path.with_name(f"baked.{kind}") for kind in ("npz", "ply", "glb", "obj")]
    bake_mesh(path.with_name(source), outputs, SPLIT)
    expected = obscurance(path, "baked.npz")
    assert 0.2 < np.nanmin(expected) < 0.9
    for kind in ("ply", "glb"):
        np.testing.assert_allclose(obscurance(path, f"baked.{kind}"), expected, atol=1e-6, err_msg=kind)

    # an OBJ has a value per vertex, as a PLY has that is not split
    bake_mesh(path.with_name(source), [path.with_name("whole.ply")], BakeSettings(samples=16))
    whole = obscurance(path, "whole.ply")
    np.testing.assert_allclose(obscurance(path, "baked.obj"), whole, atol=1e-6)
    assert holds_obscurance(path.with_name("baked.obj"))
    assert not holds_obscurance(path.with_name("room.obj"))


def test_files_of_another_mesh(path):
    bake_mesh(path.with_name("room.obj"), [path.with_name("baked.glb")], BakeSettings(samples=16))
    path.with_name("room.obj").write_text(ROOM.replace("v 2 1 0", "v 2 1 0\nv 5 5 5") + "f 2 11 6\n")
    with pytest.raises(InputError, match=r"baked\.glb: has 7 polygons of .* the mesh of one has 6 .*again"):
        obscurance(path, "baked.glb")


def test_files_without_obscurance(path):
    with pytest.raises(InputError, match=r"room\.obj: holds no obscurance; bake it with illum ao-bake"):
        obscurance(path, "room.obj")
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ply += "property float quality\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
    path.with_name("q.ply").write_text(f"{ply}0 0 0 1\n1 0 0 2\n0 1 0 7\n3 0 1 2\n")
    with pytest.raises(InputError, match=r"q\.ply: its quality is from 0 to 7, obscurance from 0 to 1"):
        obscurance(path, "q.ply")


def test_images_over_the_uv_of_a_mesh(path):
    write_picture(path.with_name("w.png"), np.tile(np.uint8([51, 153])[None, :, None], (2, 1, 3)))
    values = obscurance(path, "w.png")
    assert np.nanmin(values) == pytest.approx(0.2, abs=0.01)
    assert np.nanmax(values) == pytest.approx(0.6, abs=0.01)
    path.with_name("room.obj").write_text(
        ROOM.replace("/1", "").replace("/2", "").replace("/3", "").replace("/4", "")
    )
    with pytest.raises(InputError, match=r"object one: its obscurance .*w\.png is an image .* no uv"):
        obscurance(path, "w.png")


def test_no_ray_is_cast_and_it_is_told(illum_here, path, tmp_path):
    (tmp_path / "baked").mkdir()
    assert illum_here("ao-bake", "room.obj", "-o", "room.glb", "--samples", "16", "-q").returncode == 0
    small = ("-D", "film={width: 32, height: 20, samples: 1}", "-D", "objects.floor=null")
    done = illum_here("render", "room.glb", *small, "-o", "a.png", "-v", "--report", "r.json")
    assert done.returncode == 0, done.stderr
    assert "room.glb: subject: obscurance from room.glb, 0 rays" in done.stderr
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["obscurance_files"] == {"subject": "room.glb"}
    assert "obscurance" not in report["rays"]
    planned = illum_here("plan", "room.glb", *small)
    assert "baked   subject: obscurance from room.glb, 0 rays" in planned.stdout

    # the file's values are the scene's to leave out
    traced = illum_here("plan", "room.glb", *small, "-D", "meshes.subject.obscurance=null")
    assert "obscurance 10,240" in traced.stdout
    assert "baked   " not in traced.stdout


def repairs_of_scene(path, *overrides):
    loaded = load(path, overrides)
    return repairs_of(build(loaded.scene, loaded), outputs_of(loaded.scene, ("beauty",)))


def test_occlusion_textures_of_gltf(tmp_path):
    """R of the texture, by its strength and its own coordinates, is what ambient light is multiplied by."""
    rows = 17 * np.arange(16, dtype=np.uint8).reshape(4, 4, 1)
    write_picture(tmp_path / "w.png", np.concatenate([rows, rows * 0 + 99, rows * 0], axis=2))
    tables = [
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4"),
        np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4"),
        np.array([0, 1, 2, 0, 2, 3], "<u4"),
    ]
    views, kinds = np.cumsum([0, *(each.nbytes for each in tables)]), ("VEC3", "VEC2", "SCALAR")
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_1": 1}, "indices": 2, "material": 0}]}
        ],
        "materials": [{"occlusionTexture": {"index": 0, "texCoord": 1, "strength": 0.5}}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9728}],
        "images": [{"uri": "w.png"}],
        "accessors": [
            {"bufferView": k, "componentType": 5126 if k < 2 else 5125, "count": len(each), "type": kinds[k]}
            for k, each in enumerate(tables)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(views[k]), "byteLength": each.nbytes}
            for k, each in enumerate(tables)
        ],
        "buffers": [{"uri": "data.bin", "byteLength": int(views[-1])}],
    }
    (tmp_path / "data.bin").write_bytes(b"".join(each.tobytes() for each in tables))
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "version: 1\nambient: 1\n"
        "camera: {projection: orthographic, position: [0.5, 0.5, 2], target: [0.5, 0.5, 0], extent: 1}\n"
        "film: {width: 4, height: 4, samples: 1}\n"
        "objects: [{mesh: {file: a.gltf, obscurance: a.gltf}}]\n"
    )
    with contextlib.chdir(tmp_path.parent):
        made = pictures(Path(tmp_path.name, scene.name), (), ("obscurance", "beauty"))
    expected = 1 + 0.5 * (rows[..., 0] / 255 - 1)
    np.testing.assert_allclose(made["main", "obscurance"][..., 0], expected, atol=1e-6)
    np.testing.assert_allclose(
        made["main", "beauty"][..., 0] / made["main", "beauty"].max(), expected, atol=1e-6
    )

    # a scene that does not name the file has no obscurance; a mesh rendered alone has the file's
    scene.write_text(scene.read_text().replace(", obscurance: a.gltf", ""))
    assert (pictures(scene, (), ("obscurance",))["main", "obscurance"] == 1).all()
    repairs = repairs_of_scene(scene, "objects.0.mesh.materials=true")
    assert repairs[NO_OCCLUSION].count == 1
    named = ("objects.0.mesh.materials=true", "objects.0.mesh.obscurance=a.gltf")
    assert NO_OCCLUSION not in repairs_of_scene(scene, *named)
    assert load(tmp_path / "a.gltf").scene.meshes["subject"].obscurance == "a.gltf"
