from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import HARMLESS
from illumcli.mesh_files import _files, read_mesh

SUFFIXES = [".obj", ".ply", ".stl", ".gltf", ".glb"]


def counted(mesh: Mesh) -> dict[str, int]:
    """The counts of the mesh's repairs, without harmless ones."""
    return {what: each.count for what, each in mesh.repairs.items() if what not in HARMLESS}


def test_an_unknown_suffix_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.fbx.*\.glb, \.gltf, \.obj, \.ply, \.stl"):
        read_mesh(tmp_path / "a.fbx")


def test_the_suffix_may_be_in_capitals(tmp_path: Path) -> None:
    (tmp_path / "A.OBJ").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert read_mesh(tmp_path / "A.OBJ").polygon_count == 1


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_no_file_with_content_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match="no such file"):
        read_mesh(path)
    path.touch()
    with pytest.raises(InputError, match="is empty"):
        read_mesh(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(InputError, match="is a folder"):
        read_mesh(path)
    path.rmdir()
    os.mkfifo(path)
    with pytest.raises(InputError, match="no regular file"):
        read_mesh(path)
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(InputError, match="no regular file"):
        read_mesh(path)
    path.unlink()
    path.symlink_to(path)
    with pytest.raises(InputError, match=r"cannot be read \(Too many levels of symbolic links\); check"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_over_the_limit_is_refused_before_it_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with path.open("wb") as file:
        file.truncate(_files.LARGEST_FILE + 1)
    with pytest.raises(LimitError, match="the limit is 4 GiB"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("content", [b"\x8f\x00\xff\x13" * 50, b"hello\nworld\n", b"\n" * 200, b"\0" * 200])
def test_foreign_content_is_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"^{path}"):
        read_mesh(path)


def test_arrays_are_read_only(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(ValueError, match="read-only"):
        read_mesh(path).vertices[0] = 1


def test_a_reader_is_imported_only_for_its_files(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    code = (
        "import sys; from pathlib import Path; from illumcli.mesh_files import read_mesh;"
        "read_mesh(Path(sys.argv[1]));"
        "loaded = {name.rpartition('.')[2] for name in sys.modules if 'illumcli.mesh_files.' in name};"
        "print(loaded & {'obj', 'ply', 'stl', 'gltf'})"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "{'obj'}"


@pytest.mark.parametrize(
    ("name", "vertices", "faces"),
    [
        ("stanford-bunny.obj", 35_947, 69_451),
        ("igea.ply", 134_345, 268_686),
        ("suzanne.obj", 507, 500),
        ("spot.obj", 2_930, 5_856),
        ("teapot.obj", 3_644, 6_320),
    ],
)
def test_real_meshes_keep_their_counts(
    real_mesh: Callable[[str], Path], name: str, vertices: int, faces: int
) -> None:
    mesh = read_mesh(real_mesh(name))
    assert (len(mesh.vertices), mesh.polygon_count) == (vertices, faces)
    assert not counted(mesh)
    if name == "suzanne.obj":
        sizes = mesh.starts[1:] - mesh.starts[:-1]
        assert set(sizes.tolist()) == {3, 4}
        assert mesh.normals is not None
        assert mesh.corner_normals is not None
        assert mesh.corner_normals.min() >= 0
    if name == "spot.obj":
        assert mesh.uvs is not None
        assert mesh.uvs.shape == (3_225, 2)
    if name == "igea.ply":  # closed: every edge once in each direction, so all strips wind alike
        corners = mesh.corners.reshape(-1, 3).astype("int64")
        edges = [corners[:, i] * vertices + corners[:, (i + 1) % 3] for i in range(3)]
        there = {edge for column in edges for edge in column.tolist()}
        assert len(there) == 3 * faces
        assert there == {edge % vertices * vertices + edge // vertices for edge in there}


@pytest.mark.parametrize("name", ["../secret.mtl", "/proc/kcore", "/proc/self/mem", "out/secret.mtl"])
def test_companions_outside_the_folder_are_not_looked_at(tmp_path, monkeypatch, name):
    from illumcli.mesh_files import companions

    (tmp_path / "secret.mtl").write_text("map_Kd x.png\n")
    folder = tmp_path / "meshes"
    folder.mkdir()
    (folder / "out").symlink_to(tmp_path)
    (folder / "m.obj").write_text(f"mtllib {name}\nv 0 0 0\n")
    assert companions(folder / "m.obj") == [folder / Path(name).name]


def test_companions_are_all_that_a_mesh_may_name(tmp_path: Path) -> None:
    from illumcli.mesh_files import companions

    (tmp_path / "m.obj").write_text("# a\n MtlLib \\\nmy stuff.mtl\nmtllib \0.mtl\nv 0 0 0\n")
    (tmp_path / "my stuff.mtl").write_text("newmtl a\nmap_Kd -clamp on wood%20.png\n  map_kd\t s.png\n")
    names = {path.relative_to(tmp_path).as_posix() for path in companions(tmp_path / "m.obj")}
    assert {"my stuff.mtl", "wood .png", "s.png"} <= names
    assert not any("\0" in name for name in names)
    (tmp_path / "m.GLTF").write_text('{"uri": "data:abc", "uri" : "a%20b.bin", "uri": "http://x/y.bin"}')
    assert tmp_path / "a b.bin" in companions(tmp_path / "m.GLTF")
    assert not any("data:" in str(path) for path in companions(tmp_path / "m.GLTF"))
    (tmp_path / "m.stl").write_text("mtllib a.mtl\n")
    assert companions(tmp_path / "m.stl") == []
    (tmp_path / "none.mtl").unlink(missing_ok=True)
    (tmp_path / "plain.obj").write_text("v 0 0 0\n")
    assert companions(tmp_path / "plain.obj") == []
    assert companions(tmp_path / "missing.obj") == []


def test_a_mesh_that_does_not_fit_into_memory_is_refused_by_name(tmp_path, monkeypatch) -> None:
    from illumcli.mesh_files import stl

    def starving(path: Path) -> None:
        raise MemoryError

    monkeypatch.setattr(stl, "read", starving)
    with pytest.raises(LimitError, match=r"a\.stl: does not fit into memory; use a smaller mesh"):
        read_mesh(tmp_path / "a.stl")


def test_more_corners_than_can_be_counted_are_refused(tmp_path, monkeypatch) -> None:
    from illumcli.mesh_files import _polygons

    monkeypatch.setattr(_polygons, "MOST_CORNERS", 5)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n")
    with pytest.raises(LimitError, match="has 6 corners, the limit is 5"):
        read_mesh(tmp_path / "a.obj")


def test_a_bad_number_at_the_end_is_seen_though_numpy_only_warns(tmp_path, monkeypatch) -> None:
    """As numpy before 2.3 does: it stops there, and no program shows that warning."""
    import re

    import numpy as np

    def lenient(data: bytes, kind: type, sep: str):
        found = []
        for word in data.split():
            number = re.match(rb"[-+]?\d+", word)
            found += [int(number[0])] if number else []
            if not number or number[0] != word:
                break
        return np.array(found, kind)

    monkeypatch.setattr(np, "fromstring", lenient)
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert read_mesh(path).polygon_count == 1
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3x\n")
    with pytest.raises(InputError, match=r"a\.obj:4: '3x' is no whole number"):
        read_mesh(path)


def test_files_of_the_limit_are_read(tmp_path, monkeypatch) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(text)
    monkeypatch.setattr(_files, "LARGEST_FILE", len(text))
    assert read_mesh(tmp_path / "a.obj").polygon_count == 1
    monkeypatch.setattr(_files, "LARGEST_FILE", len(text) - 1)
    with pytest.raises(LimitError):
        read_mesh(tmp_path / "a.obj")


@pytest.mark.parametrize("name", ["/x/a.mtl", "C:/a.mtl", "C:a.mtl"])
def test_absolute_paths_are_called_so(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=rf"here: '{name}' is an absolute path; copy the file beside"):
        _files.beside(tmp_path / "m.obj", name, "here")


def test_paths_of_either_kind_of_slash_lead_into_folders(tmp_path: Path) -> None:
    assert _files.beside(tmp_path / "m.obj", "x\\y\\a.mtl", "") == tmp_path / "x" / "y" / "a.mtl"
    assert _files.beside(tmp_path / "m.obj", "x/../a.mtl", "").resolve() == tmp_path / "a.mtl"


def test_strips_wind_alike_from_the_start_of_each() -> None:
    from illumcli.mesh_files._polygons import strip

    assert strip([])[0].tolist() == strip([0, 1])[0].tolist() == []
    assert strip([5, 6, 7])[0].tolist() == [[5, 6, 7]]
    assert strip([0, 1, 2, 3])[0].tolist() == [[0, 1, 2], [2, 1, 3]]
    assert strip([0, 1, 2, -1, 3, 4, 5, 6])[0].tolist() == [[0, 1, 2], [3, 4, 5], [5, 4, 6]]
    assert strip([0, 1, 2, 3, -1, 4, 5, 6])[0].tolist() == [[0, 1, 2], [2, 1, 3], [4, 5, 6]]
    assert strip([0, 0, 1, 1, 2])[1] == 3


@pytest.mark.parametrize(("size", "sound"), [("1e18", True), ("-1e18", True), ("1.01e18", False)])
def test_coordinates_up_to_the_limit_are_read(tmp_path: Path, size: str, sound: bool) -> None:
    (tmp_path / "a.obj").write_text(f"v 0 0 {size}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    if sound:
        assert read_mesh(tmp_path / "a.obj").vertices[0, 2] == float(size)
    else:
        with pytest.raises(InputError, match=r"1 of 3 vertices are not finite or beyond 1e\+18"):
            read_mesh(tmp_path / "a.obj")
