"""`illum ao-bake`: values, errors, order, files, resumption."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from click.testing import CliRunner
from plyfile import PlyData, PlyElement

from gltf_validator import faults
from illumcli.baking.bake import bake_mesh
from illumcli.baking.baked_texture import BakedTextures
from illumcli.baking.inputs import prepare_bake
from illumcli.baking.loading import mesh_alone, surfaces_of
from illumcli.baking.measures import Measure
from illumcli.baking.occluders import occluders_of
from illumcli.baking.outputs import write_outputs
from illumcli.baking.sampling import BakeSampler, RayCounts
from illumcli.baking.settings import BakeJob, BakeOptions, BakeSettings
from illumcli.baking.vertex_points import vertex_points
from illumcli.cli import illum
from illumcli.errors import InputError, OutputError
from illumcli.geometry.corner_normals import corner_normals
from illumcli.images.encoded import png_bytes
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf.document import open_document
from illumcli.progress import no_progress
from illumcli.rays.sampling import compact_spiral_table
from illumcli.scene.load import load
from illumcli.visibility.baked import Baked, read_npz
from illumcli.visibility.falloffs.step import Step
from illumcli.visibility.obscurance import Method
from illumcli.visibility.open_hemisphere import ClusterTree
from planned import layers_of, planned

CUBE = """
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 1 5 8 4\nf 2 3 7 6
"""
STEP = """
v -1 0 -3\nv 1 0 -3\nv 1 0 0\nv -1 0 0\nv 1 1 0\nv -1 1 0\nv 9 9 9
f 4 3 2 1\nf 4 6 5 3
"""


def bake(path, *outs, **settings):
    force = settings.pop("force", False)
    return bake_mesh(path, list(outs), BakeSettings(**settings), BakeOptions(threads=2, force=force))


def wavy(tmp_path, side=24):
    """A wavy sheet in a .ply with a property of its own, and one vertex that no face uses."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side)))
    z = 0.3 * np.sin(5 * x) * np.cos(4 * y)
    table = np.zeros(side * side + 1, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("mark", "i4")])
    for name, values in zip("xyz", (x, y, z), strict=True):
        table[name][:-1] = values
    table["mark"] = np.arange(len(table))
    i, j = (g.ravel() for g in np.meshgrid(np.arange(side - 1), np.arange(side - 1), indexing="ij"))
    a = i * side + j
    quads = np.stack([a, a + 1, a + side + 1, a + side], axis=1).astype(np.int32)
    faces = np.empty(len(quads), [("vertex_indices", "i4", (4,))])
    faces["vertex_indices"] = quads
    path = tmp_path / "wavy.ply"
    PlyData(
        [PlyElement.describe(table, "vertex"), PlyElement.describe(faces, "face")], comments=["mine"]
    ).write(str(path))
    return path


@pytest.fixture
def text_mesh(tmp_path):
    def make(text, name="mesh.obj"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return make


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("away", [0.0, 1.0, 1e3, 1e6])
def test_a_convex_mesh_is_open_exactly_and_casts_no_ray(text_mesh, tmp_path, scale, away):
    corners = np.array([line.split()[1:] for line in CUBE.split("\n") if line.startswith("v")], float)
    moved = corners * scale + away * scale * 3**0.5 * np.array([1, -1, 0.5])
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in moved.tolist()]
    path = text_mesh("\n".join(lines + [line for line in CUBE.split("\n") if line.startswith("f")]))
    _, report = bake(path, tmp_path / "out.npz")
    baked = read_npz(tmp_path / "out.npz")
    assert (baked.obscurance == 1).all()
    assert (baked.standard_error == 0).all()
    assert report.sampled["obscurance"].open == 24  # three normals a vertex: its edges are sharp
    assert sum(report.sampled["obscurance"].rays.values()) == 0


def test_values_keep_the_order_and_unused_vertices_are_open(text_mesh, tmp_path):
    _, report = bake(text_mesh(STEP), tmp_path / "out.npz", samples=1024)
    w = read_npz(tmp_path / "out.npz").obscurance
    assert len(w) == 7
    assert report.unreferenced == 1
    assert w[6] == 1
    assert w[0] > 0.9  # far from the wall
    assert (w[:2] > w[2:4]).all()  # at the foot of the wall


def test_the_stated_error_is_true(tmp_path):
    path = wavy(tmp_path)
    bake(path, tmp_path / "truth.npz", samples=16384, seed=99)
    truth = read_npz(tmp_path / "truth.npz").obscurance
    covered = []
    for seed in range(6):
        _, report = bake(path, tmp_path / f"{seed}.npz", samples=64, seed=seed)
        found = read_npz(tmp_path / f"{seed}.npz")
        cast = found.standard_error > 0
        off = found.obscurance - truth
        covered.append((np.abs(off[cast]) <= 1.96 * found.standard_error[cast]).mean())
        assert 0.8 < np.sqrt(np.mean(off**2)) / report.sampled["obscurance"].rmse < 1.25
    assert 0.93 < np.mean(covered) < 0.97


def test_a_target_error_is_reached_without_bias(tmp_path):
    path = wavy(tmp_path)
    bake(path, tmp_path / "truth.npz", samples=16384, seed=99)
    truth = read_npz(tmp_path / "truth.npz").obscurance
    off = []
    for seed in range(4):
        _, report = bake(path, tmp_path / f"{seed}.npz", target_error=0.01, seed=seed)
        off.append(read_npz(tmp_path / f"{seed}.npz").obscurance - truth)
        assert report.sampled["obscurance"].rmse <= 0.01
        assert len(report.sampled["obscurance"].samples) > 1
    off = np.concatenate(off)
    assert 0.006 < np.sqrt(np.mean(off**2)) <= 0.0105
    assert abs(off.mean()) < 3 * off.std() / len(off) ** 0.5


def test_reconstructed_values_err_less_and_state_it(tmp_path):
    path = wavy(tmp_path, 64)
    bake(path, tmp_path / "truth.npz", samples=8192, seed=99)
    truth = read_npz(tmp_path / "truth.npz").obscurance
    stated, error, covered = [], [], []
    for seed in range(4):
        _, raw = bake(path, tmp_path / f"raw{seed}.npz", samples=16, seed=seed)
        _, report = bake(path, tmp_path / f"{seed}.npz", samples=16, seed=seed, reconstruct=True)
        found = read_npz(tmp_path / f"{seed}.npz")
        off = found.obscurance - truth
        cast = found.standard_error > 0
        stated.append(report.sampled["obscurance"].rmse)
        error.append(np.sqrt(np.mean(off**2)))
        covered.append((np.abs(off[cast]) <= 1.96 * found.standard_error[cast]).mean())
        assert report.sampled["obscurance"].rmse < raw.sampled["obscurance"].rmse / 2
        audit = report.sampled["obscurance"].reconstruction["audit"]
        assert audit["low"] < report.sampled["obscurance"].rmse < audit["high"]
    assert 0.9 < np.mean(np.array(stated) / error) < 1.1
    assert 0.92 < np.mean(covered) < 0.98
    assert np.mean(np.array(error)) < 0.02


def test_a_target_error_is_reached_by_reconstruction(tmp_path):
    path = wavy(tmp_path, 64)
    bake(path, tmp_path / "truth.npz", samples=8192, seed=99)
    truth = read_npz(tmp_path / "truth.npz").obscurance
    _, raw = bake(path, tmp_path / "raw.npz", target_error=0.01)
    _, report = bake(path, tmp_path / "out.npz", target_error=0.01, reconstruct=True)
    off = read_npz(tmp_path / "out.npz").obscurance - truth
    assert report.sampled["obscurance"].rmse <= 0.01
    assert 0.004 < np.sqrt(np.mean(off**2)) < 0.0115
    assert sum(report.sampled["obscurance"].rays.values()) < sum(raw.sampled["obscurance"].rays.values())


def test_a_target_that_is_not_reached_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("illumcli.baking.reconstructed.MAX_TRIALS", 1)
    _, report = bake(wavy(tmp_path), tmp_path / "out.npz", target_error=0.001, reconstruct=True)
    assert report.sampled["obscurance"].rmse > 0.001
    assert "trials did not reach it" in report.warnings[0]


def test_ply_keeps_everything_and_gets_what_was_baked(tmp_path):
    path = wavy(tmp_path)
    bake(path, tmp_path / "out.ply", color="g")
    old, new = PlyData.read(path), PlyData.read(tmp_path / "out.ply")
    assert new.byte_order == old.byte_order
    assert "mine" in new.comments
    for name in ("x", "y", "z", "mark"):
        assert np.array_equal(new["vertex"][name], old["vertex"][name])
        assert new["vertex"][name].dtype == old["vertex"][name].dtype
    assert np.array_equal(np.stack(new["face"]["vertex_indices"]), np.stack(old["face"]["vertex_indices"]))
    w = new["vertex"]["obscurance"]
    assert np.array_equal(w, new["vertex"]["quality"])
    assert np.array_equal(new["vertex"]["green"], np.rint(w * 255).astype(np.uint8))
    assert (new["vertex"]["red"] == 255).all()


NAMED = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float normal
property float uv
property float color
property float heat
property float Heat
element face 1
property list uchar int vertex_indices
end_header
0 0 0 255 0 0 0.1 1 4 7 10
1 0 0 255 0 0 0.2 2 5 8 11
0 1 0 255 0 0 0.3 3 6 9 12
3 0 1 2
"""


def test_properties_with_the_names_of_others_keep_their_values(text_mesh, tmp_path):
    """A file may call a scalar of its own `normal`, `uv` or `color`."""
    path = text_mesh(NAMED, "named.ply")
    outs = [tmp_path / "out.ply", tmp_path / "out.glb"]
    bake(path, *outs, samples=4)
    table = PlyData.read(outs[0])["vertex"]
    assert [table[name][2] for name in ("red", "color", "heat", "Heat")] == [255, 6, 9, 12]
    assert table["normal"].tolist() == pytest.approx([0.1, 0.2, 0.3])
    found = read_mesh(outs[1]).attributes
    np.testing.assert_allclose(found["color"], [[1, 0, 0]] * 3, atol=1e-6)
    scalars = {name: found[name].tolist() for name in ("_NORMAL_", "_UV_", "_COLOR_", "_HEAT", "_HEAT_")}
    assert scalars.pop("_NORMAL_") == pytest.approx([0.1, 0.2, 0.3])
    assert scalars == {"_UV_": [1, 2, 3], "_COLOR_": [4, 5, 6], "_HEAT": [7, 8, 9], "_HEAT_": [10, 11, 12]}


def test_obj_goes_to_ply_and_glb_in_its_own_order(text_mesh, tmp_path):
    path = text_mesh(CUBE.replace("v 1 1 1\n", "v 1 1 1 \n") + "v 0 3 0\nf 4 3 9\nf 8 9 7\n")
    outs = [tmp_path / f"out.{kind}" for kind in ("npz", "ply", "glb")]
    bake(path, *outs)
    mesh, baked = read_mesh(path), read_npz(outs[0])
    ply, glb = (read_mesh(out) for out in outs[1:])
    for made in (ply, glb):  # copies for the sharp edges of a cube follow in the GLB
        np.testing.assert_allclose(made.vertices[: len(mesh.vertices)], mesh.vertices, atol=1e-6)
    assert np.array_equal(np.asarray(ply.attributes["obscurance"], np.float32), baked.obscurance)
    assert np.array_equal(ply.starts, mesh.starts)
    assert np.array_equal(ply.corners, mesh.corners)
    assert len(glb.vertices) > len(mesh.vertices)
    w = np.asarray(glb.attributes["_OBSCURANCE"], np.float32)[glb.corners]
    assert set(w.tolist()) == set(baked.corner_channels["obscurance"].tolist())


def test_a_glb_keeps_all_it_has(text_mesh, tmp_path):
    bake(text_mesh(STEP), tmp_path / "first.glb", samples=16, color="r")
    bake(tmp_path / "first.glb", tmp_path / "second.glb", samples=64)
    first, second = read_mesh(tmp_path / "first.glb"), read_mesh(tmp_path / "second.glb")
    assert np.array_equal(first.attributes["color"], second.attributes["color"])
    assert not np.array_equal(first.attributes["_OBSCURANCE"], second.attributes["_OBSCURANCE"])


def test_a_glb_that_is_written_oddly_keeps_all_it_has(text_mesh, tmp_path):
    bake(text_mesh(STEP), tmp_path / "plain.glb", samples=16)
    document = open_document(tmp_path / "plain.glb")
    data = document.chunk
    document.json["extras"] = {"mine": 1}
    document.json["asset"]["extras"] = "notes"
    document.json["buffers"].append({"byteLength": 4, "uri": "data:;base64,AAAA/w=="})

    def write(path):
        text = b"\xef\xbb\xbf" + json.dumps(document.json).encode() + b"\0\0"
        chunks = struct.pack("<I", 4) + b"????1234"
        chunks += struct.pack("<I", len(text)) + b"JSON" + text
        chunks += (struct.pack("<I", len(data)) + b"BIN\0" + data) if document.chunk else b""
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks + b"more")
        return path

    bake(write(tmp_path / "odd.glb"), tmp_path / "out.glb", samples=16)
    made = open_document(tmp_path / "out.glb")
    assert made.json["extras"] == {"mine": 1}
    assert len(made.json["buffers"]) == 1
    assert b"\0\0\0\xff" in made.chunk
    assert "_OBSCURANCE" in made.json["meshes"][0]["primitives"][0]["attributes"]
    np.testing.assert_array_equal(
        read_mesh(tmp_path / "out.glb").vertices, read_mesh(tmp_path / "odd.glb").vertices
    )

    # a buffer that is a file of its own is pulled in
    (tmp_path / "data.bin").write_bytes(data)
    document.json["buffers"][0]["uri"] = "data.bin"
    document.chunk = None
    bake(write(tmp_path / "apart.glb"), tmp_path / "whole.glb", samples=16)
    whole, apart = (read_mesh(tmp_path / f"{name}.glb") for name in ("whole", "apart"))
    assert open_document(tmp_path / "whole.glb").json["extras"] == {"mine": 1}
    np.testing.assert_array_equal(whole.vertices, apart.vertices)


def test_an_obj_goes_to_glb_with_its_groups_materials_and_images(text_mesh, tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl clay\nKd 1 0 0\nmap_Kd brick.png\nmap_Ks brick.png\n")
    (tmp_path / "brick.png").write_bytes(png_bytes(np.zeros((2, 2, 3), np.uint8), srgb=True))
    lines = CUBE.replace("f ", "usemtl clay\nf ", 1).replace("f 5", "g side\nusemtl lost\nf 5")
    path = text_mesh(f"mtllib a.mtl\nvt 0.25 0.75\no cube\n{lines.replace('f 1 ', 'f 1/1 ')}v 9 9 9\n")
    _, report = bake(path, tmp_path / "out.glb", samples=16)
    assert report.left_out == [
        "out.glb: map_ks of material clay",
        "out.glb: vertices of mesh that no polygon uses, 1",
    ]
    json = open_document(tmp_path / "out.glb").json
    mesh, made = read_mesh(path), read_mesh(tmp_path / "out.glb")
    assert made.group_names == mesh.group_names
    assert [each["name"] for each in json["materials"]] == list(made.material_names) == ["clay", "lost"]
    assert "baseColorTexture" in json["materials"][0]["pbrMetallicRoughness"]
    assert len(json["images"]) == 1
    assert faults(tmp_path / "out.glb") == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"comment", b"Created by hand\ncomment"),
        (b"comment", b"comment caf\xc3\xa9"),
        (b"end_header\n", b"end_header\r\n"),
        (b"ply", b"\xef\xbb\xbfply"),
        (b"property float y", b" property float y"),
        (b"property float w", b"property float x"),
        (b"property float w", b"property int64 w"),
        (b"property float w", "property float größe".encode()),
        (b"list uchar", b"list float"),
        (b"3 0 1 2", b"3 0 1\n2"),
        (b"3 0 1 2", b"3 0 1 2 9\n3 0 1 2"),
    ],
)
def test_a_ply_that_is_read_with_repairs_is_written_too(tmp_path, old, new):
    path, out = tmp_path / "a.ply", tmp_path / "out.ply"
    path.write_bytes(
        (
            b"ply\nformat ascii 1.0\ncomment one\nelement vertex 3\nproperty float x\nproperty float y\n"
            b"property float z\nproperty float w\nelement face 1\nproperty list uchar int vertex_indices\n"
            b"end_header\n0 0 0 7\n1 0 0 8\n0 1 0 9\n3 0 1 2\n"
        ).replace(old, new)
    )
    bake(path, out, samples=4)
    made = read_mesh(out)
    np.testing.assert_array_equal(made.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(made.corners, [0, 1, 2])
    assert any(np.array_equal(each, [7, 8, 9]) for each in made.attributes.values())


def test_the_alpha_of_a_ply_is_a_share_in_a_glb(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 255 0 0 255\n1 0 0 255 0 0 51\n0 1 0 255 0 0 0\n3 0 1 2\n"
    )
    bake(path, tmp_path / "out.glb", samples=4)
    np.testing.assert_allclose(read_mesh(tmp_path / "out.glb").attributes["alpha"], [1, 0.2, 0])
    assert faults(tmp_path / "out.glb") == []


def test_textures_are_read_beside_the_mesh_that_names_them(text_mesh, tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl clay\nmap_Kd brick.png\n")
    (tmp_path / "brick.png").write_bytes(png_bytes(np.zeros((2, 2, 3), np.uint8), srgb=True))
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl clay\nf 1/1 2/2 3/3\n"
    bake(text_mesh("mtllib a.mtl\n" + triangle), tmp_path / "whole.glb", samples=4)
    ply = tmp_path / "named.ply"
    ply.write_text(
        "ply\nformat ascii 1.0\ncomment TextureFile brick.png\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    )
    scene = tmp_path / "scenes" / "a.yaml"
    scene.parent.mkdir()
    scene.write_text("version: 1\nobjects: [{mesh: {file: ../whole.glb, materials: true}}]\n")
    for source, names in ((tmp_path / "whole.glb", "glb obj"), (ply, "glb obj"), (scene, "obj")):
        for name in names.split():
            out = tmp_path / f"{source.suffix[1:]}-{name}" / f"out.{name}"
            bake(source, out, samples=4)
            if name == "obj":
                assert (out.parent / "out.0.png").exists()
            else:
                assert len(open_document(out).json["images"]) == 1


def test_an_obj_keeps_its_lines_and_takes_its_materials_along(text_mesh, tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps/brick.png").write_bytes(png_bytes(np.zeros((2, 2, 3), np.uint8), srgb=True))
    (tmp_path / "a.mtl").write_text("newmtl clay\nmap_Ke maps/brick.png\n")
    path = text_mesh("mtllib a.mtl\nusemtl clay\n" + CUBE)
    out = tmp_path / "baked" / "out.obj"
    _, report = bake(path, out, tmp_path / "out.npz", samples=64)
    assert report.left_out == []
    mesh, made, baked = read_mesh(path), read_mesh(out), read_npz(tmp_path / "out.npz")
    np.testing.assert_array_equal(made.vertices, mesh.vertices)
    np.testing.assert_array_equal(made.corners, mesh.corners)
    assert made.materials.keys() == mesh.materials.keys()
    np.testing.assert_allclose(made.attributes["obscurance"], baked.obscurance, atol=1e-6)
    assert (out.parent / "maps/brick.png").exists()
    assert bake(path, out, tmp_path / "out.npz", samples=64)[1].kept == [str(out), str(tmp_path / "out.npz")]

    # a library of another content beside the output is not replaced
    (out.parent / "a.mtl").write_text("newmtl other\n")
    out.unlink()
    with pytest.raises(OutputError, match=r"a\.mtl: a different file is there; use --force"):
        bake(path, out, samples=32)
    bake(path, out, samples=32, force=True)
    assert (out.parent / "a.mtl").read_text() == (tmp_path / "a.mtl").read_text()


def test_an_obj_with_colours_has_no_place_for_values(text_mesh, tmp_path):
    path = text_mesh(CUBE.replace("v 1 1 1", "v 1 1 1 1 0 0"))
    with pytest.raises(InputError, match=r"out\.obj: the vertices have colours, .*--color"):
        bake(path, tmp_path / "out.obj")
    bake(path, tmp_path / "out.obj", samples=4, color="g")
    assert read_mesh(tmp_path / "out.obj").attributes["color"].shape == (8, 3)


def test_a_mirrored_object_keeps_its_outside(text_mesh, tmp_path):
    text_mesh(CUBE, "cube.obj")
    scene = tmp_path / "scene.yaml"
    scene.write_text("version: 1\nobjects: [{mesh: cube.obj, transform: {scale: [-1, 1, 1]}}]\n")
    for kind in ("ply", "obj", "glb"):
        bake(scene, tmp_path / f"out.{kind}", samples=4)
        made = read_mesh(tmp_path / f"out.{kind}")
        a, b, c = (made.vertices[made.corners[made.starts[:-1] + k]] for k in range(3))
        assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0).all(), kind


def test_a_split_ply_keeps_all_it_has(tmp_path):
    head = (
        "ply\nformat ascii 1.0\ncomment mine\nelement vertex 8\nproperty float x\nproperty float y\n"
        "property float z\nproperty int mark\nelement face 6\nproperty list uchar uchar vertex_index\n"
        "property uchar red\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    )
    points = [line.split()[1:] for line in CUBE.splitlines() if line.startswith("v ")]
    faces = [[int(each) - 1 for each in line.split()[1:]] for line in CUBE.splitlines() if line[:2] == "f "]
    rows = [f"{' '.join(point)} {k}" for k, point in enumerate(points)]
    rows += [f"4 {' '.join(map(str, face))} {10 * k}" for k, face in enumerate(faces)]
    (tmp_path / "in.ply").write_text(head + "\n".join([*rows, "2 5"]) + "\n")
    work = prepare_bake(BakeJob(tmp_path / "in.ply", (tmp_path / "out.ply",), BakeSettings(split=True)))
    w, at_corners = np.linspace(0, 1, 8, dtype=np.float32), np.linspace(0, 1, 24, dtype=np.float32)
    baked = Baked({"obscurance": w}, {"content": "c"}, {"obscurance": at_corners})
    assert write_outputs(work, [tmp_path / "out.ply"], baked, BakedTextures()) == ()
    made, mesh = PlyData.read(tmp_path / "out.ply"), read_mesh(tmp_path / "out.ply")
    assert made.text
    assert made.comments[0] == "mine"
    assert made["face"]["red"].tolist() == [0, 10, 20, 30, 40, 50]
    assert made["edge"].data[0].tolist() == (2, 5)
    assert made["vertex"].count == 24
    np.testing.assert_array_equal(mesh.attributes["mark"][mesh.corners], np.ravel(faces))
    np.testing.assert_allclose(mesh.attributes["obscurance"][mesh.corners], at_corners, rtol=1e-6)


def test_an_asset_is_written_again_if_an_image_or_material_changes(text_mesh, tmp_path):
    library = tmp_path / "a.mtl"
    library.write_text("newmtl clay\nKd 1 0 0\n")
    path = text_mesh("mtllib a.mtl\nusemtl clay\n" + CUBE)
    bake(path, tmp_path / "out.glb", samples=4)
    bake(path, tmp_path / "out.npz", samples=4)
    library.write_text("newmtl clay\nKd 0 1 0\n")
    with pytest.raises(OutputError, match="a different file is there"):
        bake(path, tmp_path / "out.glb", samples=4)
    assert bake(path, tmp_path / "out.npz", samples=4)[1].kept


def test_copies_of_a_vertex_with_one_normal_get_the_same_value(tmp_path):
    mesh = read_mesh(wavy(tmp_path))
    triangles = mesh.corners.reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].ravel()
    made = corner_normals(mesh)
    normals = np.zeros_like(mesh.vertices)
    normals[mesh.corners] = made.normals[made.index]
    points = mesh.vertices[triangles]
    lines = ["v {!r} {!r} {!r}".format(*p) for p in points.tolist()]
    lines += ["vn {:.7g} {:.7g} {:.7g}".format(*n) for n in normals[triangles].tolist()]
    loose = tmp_path / "loose.obj"
    faces = [" ".join(f"{i + k}//{i + k}" for k in (1, 2, 3)) for i in range(0, len(points), 3)]
    loose.write_text("\n".join(lines + [f"f {face}" for face in faces]))
    _, report = bake(loose, tmp_path / "loose.npz")
    w = read_npz(tmp_path / "loose.npz").obscurance
    _, place = np.unique(points, axis=0, return_inverse=True)
    assert report.copies == len(points) - place.max() - 1
    for k in range(place.max() + 1):
        assert np.ptp(w[place.ravel() == k]) == 0


def test_back_faces_do_as_told(text_mesh, tmp_path):
    # a floor under a lid that shows its back
    path = text_mesh("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -9 .5 -9\nv 9 .5 -9\nv 9 .5 9\nv -9 .5 9\n"
                     "f 4 3 2 1\nf 8 7 6 5\n")  # fmt: skip
    found = {}
    for faces in ("count", "ignore", "one_sided"):
        bake(path, tmp_path / f"{faces}.npz", faces=faces)
        found[faces] = read_npz(tmp_path / f"{faces}.npz").obscurance[:4]
    assert (found["count"] < 0.1).all()
    assert (found["ignore"] == 1).all()
    assert (found["one_sided"] == 1).all()


def test_a_fit_is_right_in_the_middle_of_large_triangles(text_mesh, tmp_path):
    # a wide floor with a small lid over its middle: its vertices see nothing of the lid
    lid = "v -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nv 0 0 0\nv -1 .2 -1\nv 1 .2 -1\nv 1 .2 1\nv -1 .2 1\n"
    path = text_mesh(lid + "f 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\nf 6 7 8 9\n")
    bake(path, tmp_path / "at.npz", samples=4096)
    bake(path, tmp_path / "fit.npz", samples=65536, method="fit")
    at, fit = (read_npz(tmp_path / f"{n}.npz") for n in ("at", "fit"))
    assert at.obscurance[4] < 0.1
    # the lid covers 1/81 of the floor; a value of 0.04 at the middle would darken a third of it
    assert fit.obscurance[4] > 0.6
    assert (fit.standard_error[:5] > 0).all()


def test_smooth_falloffs_see_distance(text_mesh, tmp_path):
    path = text_mesh(STEP)
    bake(path, tmp_path / "step.npz")
    falloff = {"falloff": "linear", "max_distance": "1r"}
    bake(path, tmp_path / "soft.npz", falloff=falloff, what=("ao", "bent_normal"))
    step, soft = (read_npz(tmp_path / f"{n}.npz") for n in ("step", "soft"))
    assert (soft.obscurance[:4] > step.obscurance[:4]).all()
    bent = soft.channels["bent_normal"]
    np.testing.assert_allclose(np.linalg.norm(bent[:6], axis=1), 1, rtol=1e-5)
    assert bent[2, 2] < -0.1  # away from the wall


@pytest.mark.parametrize(
    "settings", [BakeSettings(), BakeSettings(reconstruct=True)], ids=["raw", "reconstructed"]
)
def test_threads_change_nothing_and_a_part_is_taken_up(tmp_path, monkeypatch, settings):
    path, out = wavy(tmp_path), tmp_path / "out.npz"
    monkeypatch.setattr("illumcli.baking.sampling.UNIT_RAYS", 1 << 12)
    bake_mesh(path, [tmp_path / "one.npz"], settings, BakeOptions(threads=1))
    cast, rays, two = BakeSampler._run, [], BakeOptions(threads=2)  # rays: of units of values

    def breaks(self, what, pieces, ask):
        nonlocal rays
        for number, found in cast(self, what, pieces, ask):
            if what == "values" and len(rays) == 11:
                raise KeyboardInterrupt
            rays += [pieces[number].rays] * (what == "values")
            yield number, found

    monkeypatch.setattr(BakeSampler, "_run", breaks)
    with pytest.raises(KeyboardInterrupt):
        bake_mesh(path, [out], settings, two)
    assert not out.exists()
    assert len(list(tmp_path.glob(".*.unfinished"))) == len(list(tmp_path.glob(".*"))) == 1
    monkeypatch.setattr(BakeSampler, "_run", cast)
    _, report = bake_mesh(path, [out], settings, two)
    _, whole = bake_mesh(path, [tmp_path / "two.npz"], settings, two)
    resumed, new = report.sampled["obscurance"], whole.sampled["obscurance"]
    assert (resumed.resumed, new.resumed) == (sum(rays), 0)
    assert resumed.rays == new.rays
    assert out.read_bytes() == (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    assert list(tmp_path.glob(".*")) == []


@pytest.mark.parametrize("kind", ["npz", "ply", "glb"])
def test_the_same_is_kept_and_another_refused(text_mesh, tmp_path, kind):
    path, out = text_mesh(STEP), tmp_path / f"out.{kind}"
    _, first = bake(path, out, samples=16)
    _, again = bake(path, out, samples=16)
    assert (first.written, first.kept) == ([str(out)], [])
    assert (again.written, again.kept) == ([], [str(out)])
    with pytest.raises(OutputError, match="--force"):
        bake(path, out, samples=32)
    assert bake(path, out, samples=32, force=True)[1].written == [str(out)]


def test_only_what_is_asked_for_is_written(text_mesh, tmp_path):
    path, out = text_mesh(STEP), str(tmp_path / "out.npz")
    done = CliRunner().invoke(illum, ["ao-bake", str(path), "-o", out, "--what", "bent_normal"])
    assert done.exit_code == 0
    assert list(read_npz(out).channels) == ["bent_normal"]
    scene = (
        f"version: 1\nambient: [1, 1, 1]\nobjects: [{{mesh: {{file: {path.name}, obscurance: out.npz}}}}]\n"
    )
    done = CliRunner().invoke(
        illum, ["render", str(text_mesh(scene, "scene.yaml")), "-o", str(tmp_path / "a.png")]
    )
    assert "out.npz: holds no obscurance; bake it with --what ao" in done.output + str(done.exception)


def test_the_command_says_what_is_wrong_at_once(text_mesh, tmp_path):
    path = text_mesh(STEP)
    for arguments, said in (
        (["-o", "x.jpg"], "no writer"),
        (["-o", "x.npz", "--tau", "2"], "--tau belongs to"),
        (["-o", "x.npz", "--falloff", "linear"], "--max-distance"),
        (["-o", "x.npz", "--samples", "4", "--target-error", "0.1"], "exclude each other"),
        (["-o", "x.npz", "--max-distance", "2m"], "is no distance"),
        (["-o", "x.npz", "--what", "ao,bend"], "'bend' is not one of ao, bent_normal, thickness"),
        (["-o", "x.npz", "--what", "ao,bent_normal", "--method", "fit"], "--method fit computes ao alone"),
    ):
        done = CliRunner().invoke(illum, ["ao-bake", str(path), *arguments])
        assert done.exit_code != 0
        assert said in done.output + str(done.exception)


def test_the_command_prints_files_and_writes_a_report(text_mesh, tmp_path):
    path, out = text_mesh(STEP), tmp_path / "deep" / "out.npz"
    report = tmp_path / "report.json"
    done = CliRunner().invoke(
        illum, ["ao-bake", str(path), "-o", str(out), "--max-distance", "0.5r", "--report", str(report)]
    )
    assert done.exit_code == 0
    assert done.stdout == f"{out}\n"
    said = json.loads(report.read_text())
    assert said["sampled"]["obscurance"]["rmse"] > 0
    assert said["unreferenced"] == 1
    about = read_npz(out).about
    assert about["parameters"]["falloff"] == {"falloff": "step", "max_distance": "0.5r"}


@pytest.mark.parametrize(
    ("options", "is_reconstructed"),
    [
        (["--target-error", "0.05"], True),
        (["--target-error", "0.05", "--no-reconstruct"], False),
        (["--samples", "16"], False),
        (["--samples", "16", "--reconstruct"], True),
    ],
)
def test_the_command_reconstructs_where_a_target_or_the_user_asks(
    text_mesh, tmp_path, options, is_reconstructed
):
    out, report = tmp_path / "out.npz", tmp_path / "report.json"
    arguments = ["ao-bake", str(text_mesh(STEP)), "-o", str(out), "--report", str(report), *options]
    done = CliRunner().invoke(illum, arguments)
    assert done.exit_code == 0
    assert ("audited" in done.stderr) == is_reconstructed
    for data in (json.loads(report.read_text()), read_npz(out).about):
        assert (data["sampled"]["obscurance"]["reconstruction"] is not None) == is_reconstructed
    assert read_npz(out).about["parameters"]["reconstruct"] == is_reconstructed


# A floor and a wall that share the edge x = 0, smooth over it: the normal there leans by 45 degrees.
VALLEY = """
v 0 0 -500\nv 0 0 0\nv 0 0 500\nv 500 0 -500\nv 500 0 0\nv 500 0 500\nv 0 500 -500\nv 0 500 0\nv 0 500 500
vn 1 1 0
"""
FACES = {
    "quads": "f 1//1 2//1 5//1 4//1\nf 2//1 3//1 6//1 5//1\nf 1//1 7//1 8//1 2//1\nf 2//1 8//1 9//1 3//1\n",
    "triangles": "f 1//1 2//1 4//1\nf 2//1 5//1 4//1\nf 2//1 3//1 5//1\nf 3//1 6//1 5//1\n"
    "f 1//1 7//1 8//1 2//1\nf 2//1 8//1 9//1\nf 2//1 9//1 3//1\n",
}


@pytest.mark.parametrize("faces", FACES)
def test_w_at_a_hollow_edge_is_what_pictures_tend_to(text_mesh, tmp_path, faces):
    """About a normal that leans by t to the open side w at the foot of an endless wall is (1 + sin t) / 2:
    what points below floor or wall is mirrored there."""
    found = []
    for seed in range(10):
        bake(text_mesh(VALLEY + FACES[faces]), tmp_path / "out.npz", seed=seed, samples=1024, force=True)
        found.append(read_npz(tmp_path / "out.npz").obscurance[1])
    w = np.array(found, float)
    assert abs(w.mean() - (1 + 0.5**0.5) / 2) < 4.5 * w.std(ddof=1) / len(w) ** 0.5


ROOM = "v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nv 0 1 0\nv 2 3 0\nv 0 1 2\nf 1 5 6 2\nf 1 4 7 5\n"


def test_errors_at_a_hollow_edge_keep_falling_with_the_rays(text_mesh, tmp_path):
    # the vertices of a smooth trough: what is hidden depends on the side of the edge that a ray starts on
    path = text_mesh(
        "v 0 1 -2\nv 0 1 2\nv 0 0 -2\nv 0 0 2\nv 1 0.2 -2\nv 1 0.2 2\nf 1 2 4 3\nf 3 4 6 5\ns 1\n"
    )
    loaded = mesh_alone(path, ())
    surfaces, _ = surfaces_of(loaded.scene, loaded)
    points = vertex_points(surfaces).points
    assert not points.is_flat.any()
    occluders = occluders_of(loaded.scene.object_names(), points.geometry, BakeSettings(), {})
    sampler = BakeSampler(points, occluders, Measure(Method(1, Step(), 1.0)), 0, 1, no_progress)

    def rmse(samples):
        counts = RayCounts(np.arange(len(points.key)), np.full(len(points.key), samples))
        pairs = [
            [sampler.estimate("values", counts, 2 * pair + half).values.w for half in (0, 1)]
            for pair in range(24)
        ]
        return np.sqrt(np.mean([np.square(a.astype(float) - b) / 2 for a, b in pairs]))

    assert rmse(64 << 8) < rmse(64) / 25  # as N^-3/4 is 64; sixteen starts gave 3.6


def test_only_results_are_dithered_and_audits_stay_independent(tmp_path):
    loaded = mesh_alone(wavy(tmp_path), ())
    surfaces, _ = surfaces_of(loaded.scene, loaded)
    points = vertex_points(surfaces).points
    occluders = occluders_of(loaded.scene.object_names(), points.geometry, BakeSettings(), {})
    counts = RayCounts(np.arange(len(points.key)), np.full(len(points.key), 16))

    def values(is_dithered, replicate):
        measure = Measure(Method(1, Step(), 1.0))
        sampler = BakeSampler(points, occluders, measure, 0, 1, no_progress, is_dithered=is_dithered)
        return sampler.estimate("values", counts, replicate).values.w.tobytes()

    assert values(True, 0) != values(False, 0)
    assert values(True, 3) == values(False, 3)


def test_points_of_a_smooth_surface_start_one_packet_at_one_place(tmp_path):
    loaded = mesh_alone(wavy(tmp_path), ())
    surfaces, _ = surfaces_of(loaded.scene, loaded)
    points = vertex_points(surfaces).points
    flat = np.flatnonzero(points.is_flat)
    assert len(flat) > len(points.key) / 2
    over = points.hemispheres(flat, np.full(len(flat), 0.3), 100, "spiral")
    assert over.origins_per_point == 7
    table = compact_spiral_table(100)
    assert over.origin_of_ray is not None
    assert over.origin_of_ray[table.number].tolist() == sorted(list(range(6)) * 16 + [6] * 4)


def test_values_do_not_depend_on_how_a_polygon_is_cut(text_mesh, tmp_path):
    found = []
    for name, floor in (("a", "f 4 3 2 1\n"), ("b", "f 4 3 2\nf 4 2 1\n"), ("c", "f 4 3 1\nf 3 2 1\n")):
        scene = text_mesh(
            "version: 1\nobscurance: {about: geometric}\nobjects: [{mesh: {file: room.obj}}]\n", "room.yaml"
        )
        text_mesh(ROOM + floor, "room.obj")
        bake(scene, tmp_path / f"{name}.npz", samples=4096)
        found.append(read_npz(tmp_path / f"{name}.npz"))
    for other in found[1:]:
        error = np.hypot(found[0].standard_error, other.standard_error)
        assert (np.abs(other.obscurance - found[0].obscurance) <= 4 * error).all()


def test_copies_at_a_pole_of_degenerate_quads_agree(text_mesh, tmp_path):
    """A hollow cone: two corners of each quad lie at the tip, and the cut leaves one without area."""
    angle = 2 * np.pi * np.arange(12) / 12
    lines = [f"v 0 -1 0\nv 0 -1 0\nv {np.cos(a)} 0 {np.sin(a)}\nv {np.cos(b)} 0 {np.sin(b)}"
             for a, b in zip(angle, np.roll(angle, -1), strict=True)]  # fmt: skip
    faces = [f"f {4 * k + 1} {4 * k + 2} {4 * k + 4} {4 * k + 3}" for k in range(12)]
    bake(text_mesh("\n".join(lines + faces)), tmp_path / "out.npz", samples=1024)
    baked = read_npz(tmp_path / "out.npz")
    tips = np.arange(48) % 4 < 2
    assert (baked.obscurance < 0.99).all()
    assert (np.abs(baked.obscurance[tips] - baked.obscurance[tips].mean()) < 0.02).all()


HARD = CUBE + (
    "vn 0 0 -1\nvn 0 0 1\nvn 0 -1 0\nvn 0 1 0\nvn -1 0 0\nvn 1 0 0\n"
    "v -9 -1 -9\nv 9 -1 -9\nv 9 -1 9\nv -9 -1 9\n"
)


@pytest.fixture
def hard_cube(text_mesh):
    """A cube whose faces have their own normals, on a floor."""
    lines = HARD.replace("f ", "# ").split("\n")
    quads = [line.split()[1:] for line in CUBE.split("\n") if line.startswith("f")]
    faces = [" ".join(f"{v}//{k + 1}" for v in quad) for k, quad in enumerate(quads)]
    return text_mesh("\n".join([*lines, *(f"f {face}" for face in faces), "f 12//4 11//4 10//4 9//4"]))


def test_a_vertex_on_a_hard_edge_has_a_value_for_each_normal(hard_cube, tmp_path):
    outs = [tmp_path / name for name in ("out.npz", "out.glb", "out.ply")]
    _, report = bake(hard_cube, *outs, samples=1024)
    baked, mesh = read_npz(outs[0]), read_mesh(hard_cube)
    at = baked.corner_channels["obscurance"].reshape(-1, 4)
    assert (at[3] == 1).all()  # the top
    low = mesh.vertices[mesh.corners.reshape(-1, 4), 1] < 0
    assert (np.abs(at[[0, 1, 4, 5]] - 0.5)[low[[0, 1, 4, 5]]] < 0.2).all()  # the foot of a side
    mean = np.bincount(mesh.corners, baked.corner_channels["obscurance"]) / np.bincount(
        mesh.corners
    )  # all right angles
    np.testing.assert_allclose(baked.obscurance, mean, rtol=1e-6)
    assert report.left_out == ["out.ply: normals of mesh that differ between the polygons of a vertex"]

    # GLB: the file's own vertices first, then a copy for every other normal
    glb, ply = read_mesh(outs[1]), read_mesh(outs[2])
    assert len(ply.vertices) == 12
    assert len(glb.vertices) == 28
    np.testing.assert_allclose(glb.vertices[:12], mesh.vertices, atol=1e-6)
    corner = np.asarray(glb.attributes["_OBSCURANCE"], np.float32)[glb.corners]
    assert set(corner.tolist()) == set(baked.corner_channels["obscurance"].tolist())
    assert glb.normals is not None


def test_split_gives_a_ply_a_vertex_for_each_normal(hard_cube, tmp_path):
    _, report = bake(hard_cube, tmp_path / "out.ply", split=True)
    bake(hard_cube, tmp_path / "out.npz")
    made, baked = read_mesh(tmp_path / "out.ply"), read_npz(tmp_path / "out.npz")
    assert report.left_out == []
    assert len(made.vertices) == 28
    assert np.array_equal(np.asarray(made.attributes["obscurance"], np.float32)[made.corners],
                          baked.corner_channels["obscurance"])  # fmt: skip
    with pytest.raises(InputError, match=r"--split belongs to \.ply"):
        bake(hard_cube, tmp_path / "other.npz", split=True)


def test_a_picture_reads_the_values_of_corners(hard_cube, text_mesh, tmp_path):
    bake(hard_cube, tmp_path / "cube.npz", samples=1024)
    text = (
        "version: 1\ncamera: {position: [0, 9, 0.01], target: [0, 0, 0], fov: 8}\n"
        "film: {width: 9, height: 9}\nambient: 1\nobscurance: {samples: 4}\n"
        "objects: [{name: mesh, mesh: {file: mesh.obj, obscurance: cube.npz}}]\n"
    )
    scene = load(text_mesh(text, "scene.yaml"))
    w = layers_of(planned(scene, ["obscurance"]))["obscurance"]
    np.testing.assert_allclose(w, 1, atol=1e-6)  # the top, whose vertices have 0.7 in the mean


def test_flat_normals_of_faces_that_are_turned_round_point_outwards(hard_cube, text_mesh, tmp_path):
    lines = hard_cube.read_text().split("\n")
    turned = ["f " + " ".join(reversed(line.split()[1:])) if line.startswith("f") else line for line in lines]
    text_mesh("\n".join(turned[:-1]), "turned.obj")  # without the floor
    objects = "objects: [{mesh: {file: turned.obj}}]\n"
    scene = text_mesh("version: 1\nobscurance: {about: geometric}\n" + objects, "turned.yaml")
    bake(scene, tmp_path / "out.npz", what=("ao", "bent_normal"))
    baked, mesh = read_npz(tmp_path / "out.npz"), read_mesh(tmp_path / "turned.obj")
    assert (baked.obscurance == 1).all()
    np.testing.assert_allclose(
        baked.corner_channels["bent_normal"], mesh.normals[mesh.corner_normals], atol=1e-6
    )


def test_a_mesh_that_is_turned_inside_out_is_told(text_mesh, tmp_path):
    _, report = bake(text_mesh(CUBE), tmp_path / "right.npz")
    assert report.warnings == []
    inside_out = "\n".join(
        "f " + " ".join(reversed(line.split()[1:])) if line.startswith("f") else line
        for line in CUBE.split("\n")
    )
    _, report = bake(text_mesh(inside_out), tmp_path / "out.npz")
    assert "the polygons seem to face inwards" in report.warnings[0]


def test_an_object_without_open_triangles_is_not_searched_for_them(text_mesh, tmp_path, monkeypatch):
    y, x = (each.ravel() for each in np.mgrid[-1:1:20j, -1:1:20j])
    saddle = "".join(f"v {a} {b} {a * b}\n" for a, b in zip(x, y, strict=True))
    saddle += "".join(f"f {k} {k + 1} {k + 21} {k + 20}\n" for k in range(1, 380) if k % 20)
    text_mesh(saddle, "saddle.obj")
    scene = tmp_path / "scene.yaml"
    ball = "{mesh: {shape: sphere}, transform: {translate: [9, 0, 0]}}"
    scene.write_text(f"version: 1\nobjects: [{{mesh: saddle.obj}}, {ball}]\n")
    tested = []
    whole = ClusterTree.is_open
    monkeypatch.setattr(
        ClusterTree, "is_open", lambda self, count, planes: tested.append(count) or whole(self, count, planes)
    )
    report = bake(scene, tmp_path / "out.npz", samples=8, occluders=("own",))[1]
    assert report.sampled["obscurance"].open > 0
    assert sum(tested) == report.triangles - 2 * 19 * 19
