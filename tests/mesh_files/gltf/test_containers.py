"""What surrounds the geometry of a glTF file: chunks, JSON, URIs, buffers, required extensions."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import pytest

from illumcli.errors import InputError
from illumcli.mesh_files import companions, read_mesh


def counted(path: Path) -> dict[str, int]:
    return {what: each.count for what, each in read_mesh(path).repairs.items() if what != "unused vertices"}


def test_bytes_behind_the_announced_end_are_counted(tmp_path: Path, square: Any) -> None:
    path = square().write(tmp_path / "a.glb")
    path.write_bytes(path.read_bytes() + b"more bytes")
    assert counted(path) == {"bytes behind the announced end": 10}
    assert read_mesh(path).repairs["bytes behind the announced end"].first == ""


def test_an_announced_length_that_is_wrong_is_counted(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.data += b"an image"  # behind all geometry
    path = scene.write(tmp_path / "a.glb")
    whole = path.read_bytes()
    for length in (0, 12, 100, len(whole) - 4, len(whole) + 4):
        path.write_bytes(whole[:8] + length.to_bytes(4, "little") + whole[12:])
        assert read_mesh(path).polygon_count == 2
        word = "shorter" if length > len(whole) else "longer"
        assert counted(path) == {f"files {word} than announced": 1}
    path.write_bytes(whole[:-6])
    assert counted(path) == {"files shorter than announced": 1, "buffers shorter than announced": 1}


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_json_in_other_encodings(tmp_path: Path, square: Any, encoding: str) -> None:
    scene = square()
    scene.json["nodes"][0]["name"] = "Würfel"
    path = scene.write(tmp_path / "a.gltf")
    path.write_bytes(path.read_text().replace("W\\u00fcrfel", "Würfel").encode(encoding))
    path.write_bytes(path.read_bytes() + "\0\0\n".encode(encoding.removesuffix("-sig"))[-6:])
    name = "W\N{REPLACEMENT CHARACTER}rfel" if encoding == "latin-1" else "Würfel"
    assert read_mesh(path).group_names == (name,)


def test_chunks_in_any_order_and_unknown_ones(tmp_path: Path, square: Any) -> None:
    path = square().write(tmp_path / "a.glb")
    whole = path.read_bytes()
    size = int.from_bytes(whole[12:16], "little")
    text, binary = whole[12 : 20 + size], whole[20 + size :]
    unknown = (4).to_bytes(4, "little") + b"ABCDEFGH"
    for body in (binary + text, text + unknown + binary, unknown + text + binary + unknown):
        path.write_bytes(b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body)
        assert counted(path) == {}
        assert read_mesh(path).polygon_count == 2


@pytest.mark.parametrize(
    "head", ["data:;base64,", "data:text/plain;charset=utf-8;base64,", "DATA:application/gltf-buffer;BASE64,"]
)
@pytest.mark.parametrize("form", ["plain", "unpadded", "safe", "lines", "percent"])
def test_data_uris_of_any_form(tmp_path: Path, square: Any, head: str, form: str) -> None:
    scene = square()
    scene.data += b"\xfb\xff\xfe\xff"  # has both letters that differ between the alphabets
    code = base64.b64encode(scene.data).decode()
    body = {
        "plain": code,
        "unpadded": code.rstrip("="),
        "safe": code.replace("+", "-").replace("/", "_"),
        "lines": "\n ".join(code[i : i + 20] for i in range(0, len(code), 20)),
        "percent": code.replace("+", "%2B").replace("=", "%3d"),
    }[form]
    assert read_mesh(scene.write(tmp_path / "a.gltf", uri=head + body)).polygon_count == 2


def test_files_by_percent_encoded_and_by_plain_names(tmp_path: Path, square: Any) -> None:
    scene = square()
    for name, uri in [
        ("a b.bin", "a%20b.bin"),
        ("c d.bin", "c d.bin"),
        ("50%.bin", "50%.bin"),
        ("e%20f.bin", "e%20f.bin"),
        ("Würfel.bin", "W%C3%BCrfel.bin"),
        ("deep/g.bin", "deep\\g.bin"),
    ]:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(scene.data)
        path = scene.write(tmp_path / "a.gltf", uri=uri)
        assert read_mesh(path).polygon_count == 2
        assert (tmp_path / name) in companions(path)


def test_a_buffer_longer_than_its_data_is_read_as_far_as_it_is_used(tmp_path: Path, square: Any) -> None:
    scene = square()
    path = scene.write(tmp_path / "a.gltf")
    document = json.loads(path.read_text())
    document["buffers"][0]["byteLength"] += 100
    path.write_text(json.dumps(document))
    assert counted(path) == {"buffers shorter than announced": 1}


def test_required_extensions_that_hide_no_geometry_are_named(tmp_path: Path, square: Any) -> None:
    names = [
        "KHR_materials_clearcoat",
        "EXT_texture_webp",
        "KHR_lights_punctual",
        "MSFT_lod",
        "KHR_xmp_json_ld",
        "ACME_unheard_of",
        "ACME\n\x1b[31m" + "x" * 100,
    ]
    scene = square()
    read = ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_unlit", "KHR_node_visibility"]
    scene.json["extensionsRequired"] = [*names, *read, 7]
    path = scene.write(tmp_path / "a.glb")
    shown = [*names[:-1], "ACME??[31m" + "x" * 50, 7]
    expected = {f"required extension {name}, read in its core state": 1 for name in shown}
    assert counted(path) == expected


def test_geometry_that_is_compressed_is_refused_by_the_name_of_its_extension(
    tmp_path: Path, square: Any
) -> None:
    scene = square()
    primitive = scene.json["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    scene.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    assert read_mesh(scene.write(tmp_path / "a.glb")).polygon_count == 2  # the core has it as well
    for accessor in scene.json["accessors"]:
        del accessor["bufferView"]
    with pytest.raises(
        InputError, match=r"primitives\[0\] .* KHR_draco_mesh_compression alone.*; export the"
    ):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_views_that_are_compressed_are_read_where_they_have_a_fallback(tmp_path: Path, square: Any) -> None:
    scene = square()
    said = {"EXT_meshopt_compression": {"buffer": 1, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES"}}
    scene.json["bufferViews"][0]["extensions"] = said
    path = scene.write(tmp_path / "a.gltf")
    assert read_mesh(path).polygon_count == 2
    document = json.loads(path.read_text())
    document["buffers"][0].pop("uri")
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"bufferViews\[0\] .* EXT_meshopt_compression alone.*; export the"):
        read_mesh(path)


def test_a_version_may_be_a_number(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["asset"]["version"] = 2.0
    assert read_mesh(scene.write(tmp_path / "a.glb")).polygon_count == 2
