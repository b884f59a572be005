"""No input may crash a reader, hang it, or load as a mesh that is not sound."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files import read_mesh
from illumcli.shading.materials import imported_model

POINTS = np.array([[0, 0, 0], [1, 0, 0.5], [1, 1, 0], [0, 1, 0.25], [0.5, 0.5, 1]], "<f4")
FACES = [[0, 1, 2, 3], [0, 4, 1], [1, 4, 2], [2, 4, 3]]


def obj() -> bytes:
    rows = ["# five points", "mtllib a.mtl", *(f"v {x} {y} {z}" for x, y, z in POINTS.tolist())]
    rows += ["vt 0 0.5", "vt 1.0 0.25", "vn 0 0 1", "vn 0 1 0", "g left", "usemtl red"]
    rows += ["f " + " ".join(f"{v + 1}/{1 + v % 2}/1" for v in face) for face in FACES]
    rows += ["s 1", "f -5//-2 -4//2 \\", " -3//1", "f 1 2 3 4"]
    return "\n".join(rows).encode()


def ply_head(kind: str) -> bytes:
    lines = [f"ply\nformat {kind} 1.0\ncomment five points\nelement vertex 5"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    lines += ["element face 4\nproperty list uchar int vertex_indices\nproperty char flag"]
    lines += ["element tristrips 1\nproperty list int int vertex_indices\nend_header\n"]
    return "\n".join(lines).encode()


def ply_text() -> bytes:
    rows = [f"{x} {y} {z} 0 0 1 10 20 30" for x, y, z in POINTS.tolist()]
    rows += [" ".join(map(str, [len(face), *face, 7])) for face in FACES]
    return ply_head("ascii") + "\n".join([*rows, "7 0 1 2 -1 2 3 4", ""]).encode()


def ply_binary(order: str, kind: str) -> bytes:
    body = b"".join(struct.pack(f"{order}6f3B", *point, 0, 0, 1, 10, 20, 30) for point in POINTS.tolist())
    body += b"".join(struct.pack(f"{order}B{len(face)}ib", len(face), *face, 7) for face in FACES)
    return ply_head(kind) + body + struct.pack(f"{order}8i", 7, 0, 1, 2, -1, 2, 3, 4)


def stl_text() -> bytes:
    lines = ["solid s"]
    for face in FACES[1:]:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += ["vertex " + " ".join(map(str, POINTS[v].tolist())) for v in face]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid s", ""]).encode()


def stl_binary() -> bytes:
    facets = b"".join(np.zeros(3, "<f4").tobytes() + POINTS[face].tobytes() + b"\0\0" for face in FACES[1:])
    return b"solid".ljust(80) + struct.pack("<I", 3) + facets


def gltf_parts() -> tuple[dict, bytes]:
    """A document with a bit of everything: skin, target, instances, sparse rows, textures, zeros."""
    half = np.full((5, 4), 0.5, "<f4")
    blocks = {
        "points": POINTS,
        "indices": np.array([*FACES[1:]], "<u2"),
        "color": np.full((5, 4), 128, "u1"),
        "uv": POINTS[:, :2].copy(),
        "joints": np.array([[0, 1, 0, 0]] * 5, "u1"),
        "weights": half,
        "binding": np.tile(np.eye(4, dtype="<f4"), (2, 1, 1)),
        "places": np.array([[0, 0, 0], [3, 0, 0]], "<f4"),
        "row": np.array([4], "<u2"),
        "moved": np.array([[0.5, 0.5, 2]], "<f4"),
        "image": np.frombuffer(b"\x89PNG and no more", "u1"),
    }
    data, views = b"", {}
    for name, block in blocks.items():
        views[name] = {"buffer": 0, "byteOffset": len(data), "byteLength": block.nbytes}
        data += block.tobytes() + b"\0" * (-block.nbytes % 4)
    number = {name: i for i, name in enumerate(views)}

    def accessor(name: str, kind: int, count: int, shape: str, **more: Any) -> dict[str, Any]:
        return {"bufferView": number[name], "componentType": kind, "count": count, "type": shape, **more}

    sparse = {
        "count": 1,
        "indices": {"bufferView": number["row"], "componentType": 5123},
        "values": {"bufferView": number["moved"]},
    }
    accessors = [
        accessor("points", 5126, 5, "VEC3", sparse=sparse),
        accessor("indices", 5123, 9, "SCALAR"),
        accessor("color", 5121, 5, "VEC4", normalized=True),
        accessor("uv", 5126, 5, "VEC2"),
        accessor("joints", 5121, 5, "VEC4"),
        accessor("weights", 5126, 5, "VEC4"),
        accessor("binding", 5126, 2, "MAT4"),
        accessor("places", 5126, 2, "VEC3"),
        {"componentType": 5126, "count": 5, "type": "VEC3"},
    ]
    own = {"POSITION": 0, "COLOR_0": 2, "TEXCOORD_0": 3, "TEXCOORD_1": 3, "NORMAL": 0}
    turned = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2], "texCoord": 1}}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "extensionsRequired": ["KHR_texture_transform"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"mesh": 0, "rotation": [0, 0, 0.6, 0.8], "children": [1, 2, 3], "weights": [0.5]},
            {
                "mesh": 0,
                "scale": [1, 2, -1],
                "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 7, "SCALE": 7}}},
            },
            {"mesh": 1, "skin": 0, "extensions": {"KHR_node_visibility": {"visible": True}}},
            {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 3, 4, 1]},
        ],
        "skins": [{"joints": [3, 0], "inverseBindMatrices": 6}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": own, "indices": 1, "material": 0, "targets": [{"POSITION": 8}], "mode": 4}
                ],
                "weights": [1],
            },
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "JOINTS_0": 4, "WEIGHTS_0": 5}, "indices": 1, "mode": 5}
                ]
            },
        ],
        "materials": [
            {
                "name": "red",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [1, 0.5, 0.25, 1],
                    "baseColorTexture": {"index": 0, "extensions": turned},
                    "metallicFactor": 0.5,
                    "roughnessFactor": 0.5,
                },
                "emissiveFactor": [1, 1, 1],
                "emissiveTexture": {"index": 1, "texCoord": 0},
                "extensions": {
                    "KHR_materials_emissive_strength": {"emissiveStrength": 2},
                    "KHR_materials_ior": {"ior": 1.5},
                },
            }
        ],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}],
        "images": [{"bufferView": number["image"], "mimeType": "image/png"}, {"uri": "wood.png"}],
        "samplers": [{"wrapS": 33648, "wrapT": 33648, "magFilter": 9728}],
        "accessors": accessors,
        "bufferViews": list(views.values()),
        "buffers": [{"byteLength": len(data)}],
    }
    return document, data


def gltf() -> bytes:
    document, data = gltf_parts()
    document["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
    return json.dumps(document).encode()


def glb(changed: Any = None) -> bytes:
    """The document in one file, its JSON replaced by `changed`."""
    document, data = gltf_parts()
    document = document if changed is None else changed
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def mtl() -> bytes:
    return b"newmtl red\nKa 0 0 0\nKd 0.5 0.25 1\nKs 1 1 1\nNs 20\nillum 2\nd 1.0\nmap_Kd -s 1 1 1 wood.png\n"


SOUND = {
    "obj": (".obj", obj()),
    "ply text": (".ply", ply_text()),
    "ply little": (".ply", ply_binary("<", "binary_little_endian")),
    "ply big": (".ply", ply_binary(">", "binary_big_endian")),
    "stl text": (".stl", stl_text()),
    "stl binary": (".stl", stl_binary()),
    "gltf": (".gltf", gltf()),
    "glb": (".glb", glb()),
}

WORDS = [
    b"nan",
    b"-1",
    b"0",
    b"1e999",
    b"99999999999",
    b"//",
    b"\n",
    b" ",
    b"\\\n",
    b"#",
    b"-",
    b"4294967295",
    b"[",
    b"{",
]


def mutated(rng: np.random.Generator, content: bytes) -> bytes:
    """`content` after one to four accidents."""
    data = bytearray(content)
    for _ in range(rng.integers(1, 5)):
        at, end = sorted(rng.integers(0, len(data) + 1, 2).tolist())
        match rng.integers(0, 7):
            case 0 if at < len(data):
                data[at] = int(rng.integers(256))
            case 1 if at < len(data):
                data[at] ^= 1 << int(rng.integers(8))
            case 2:
                del data[at : at + int(rng.integers(1, 9))]
            case 3:
                data[at:at] = WORDS[rng.integers(len(WORDS))]
            case 4:
                data[at : at + 4] = rng.bytes(4)
            case 5:
                data[at:at] = data[at : min(end, at + 40)]
            case 6 if rng.random() < 0.3:
                del data[at:]
        if not data:
            break
    return bytes(data)


def assert_sound(mesh: Mesh) -> None:
    assert mesh.polygon_count > 0
    assert (np.abs(mesh.vertices) <= 1e18).all()
    assert mesh.starts[0] == 0
    assert mesh.starts[-1] == len(mesh.corners)
    assert np.diff(mesh.starts).min() >= 3
    assert mesh.corners.min() >= 0
    assert mesh.corners.max() < len(mesh.vertices)
    for rows, corners in ((mesh.normals, mesh.corner_normals), (mesh.uvs, mesh.corner_uvs)):
        assert (rows is None) == (corners is None)
        if rows is not None and corners is not None:
            assert len(corners) == len(mesh.corners)
            assert corners.min() >= -1
            assert corners.max() < len(rows)
            assert np.isfinite(rows[corners[corners >= 0]]).all()
    for names, ids in (
        (mesh.material_names, mesh.polygon_materials),
        (mesh.group_names, mesh.polygon_groups),
    ):
        if ids is not None:
            assert len(ids) == mesh.polygon_count
            assert ids.min() >= -1
            assert ids.max() < len(names)
    for keys in mesh.materials.values():
        imported_model(keys, Path())
    for values in mesh.attributes.values():
        assert len(values) == len(mesh.vertices)
        assert values.dtype.kind in "iu" or np.isfinite(values).all()


def read_or_refused(path: Path) -> None:
    """A sound mesh, or an error that begins with a place in the folder of the mesh."""
    try:
        mesh = read_mesh(path)
    except (InputError, LimitError) as error:
        message = str(error)
    else:
        assert_sound(mesh)
        return
    assert message.startswith(str(path.parent))
    assert "; " in message


@pytest.mark.parametrize("name", SOUND)
def test_the_seeds_are_sound(tmp_path: Path, name: str) -> None:
    suffix, content = SOUND[name]
    (tmp_path / "a.mtl").write_bytes(mtl())
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    assert_sound(read_mesh(path))


@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_accidents_end_in_a_sound_mesh_or_a_named_fault(tmp_path: Path, name: str, count: int) -> None:
    suffix, content = SOUND[name]
    (tmp_path / "a.mtl").write_bytes(mtl())
    path = tmp_path / f"a{suffix}"
    for seed in range(count):
        path.write_bytes(mutated(np.random.default_rng(seed), content))
        read_or_refused(path)


def test_accidents_to_a_material_library(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_bytes(obj())
    for seed in range(400):
        (tmp_path / "a.mtl").write_bytes(mutated(np.random.default_rng(seed), mtl()))
        read_or_refused(tmp_path / "a.obj")


ODD = [None, True, -1, 0, 1, 2, 5, 7, 99, 2**40, 2**70, 0.5, -0.0, 1e300, float("nan"), float("inf"), "", "0"]
ODD += [
    "x" * 5000,
    "data:,",
    "../a",
    "\ud800",
    [],
    [0],
    [0, 0],
    [[0]],
    ["a"],
    {},
    {"0": 0},
    {"bufferView": 0},
]


def rewritten(rng: np.random.Generator, part: Any) -> Any:
    """A part of a document with something else in one place of it."""
    if not isinstance(part, dict | list) or not part or rng.random() < 0.1:
        return ODD[rng.integers(len(ODD))]
    keys = list(part) if isinstance(part, dict) else list(range(len(part)))
    key = keys[rng.integers(len(keys))]
    if rng.random() < 0.1:
        kept = [other for other in keys if other != key]
        return {k: part[k] for k in kept} if isinstance(part, dict) else [part[k] for k in kept]
    changed = dict(part) if isinstance(part, dict) else list(part)
    changed[key] = rewritten(rng, part[key])
    return changed


@pytest.mark.parametrize("count", [1000, pytest.param(50_000, marks=pytest.mark.slow)])
def test_accidents_to_the_parts_of_a_gltf_document(tmp_path: Path, count: int) -> None:
    (tmp_path / "wood.png").write_bytes(b"")
    for seed in range(count):
        rng = np.random.default_rng(seed)
        document, _ = gltf_parts()
        for _ in range(rng.integers(1, 4)):
            document = rewritten(rng, document)
        (tmp_path / "a.glb").write_bytes(glb(document))
        read_or_refused(tmp_path / "a.glb")


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_library_refuses_a_mesh(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes(obj())
    for seed in range(count):
        (tmp_path / "a.mtl").write_bytes(mutated(np.random.default_rng(seed), mtl()))
        assert_sound(read_mesh(path))
