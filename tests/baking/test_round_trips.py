"""Meshes with seams in every format, to every format: corners keep places, uv, normals, colours, values."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from illumcli.baking.baked_texture import BakedTextures
from illumcli.baking.inputs import prepare_bake
from illumcli.baking.outputs import write_outputs
from illumcli.baking.settings import BakeJob, BakeSettings
from illumcli.color import to_srgb
from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files import read_mesh
from illumcli.visibility.baked import Baked, read_npz


@st.composite
def obj_texts(draw: st.DrawFn) -> str:
    """An OBJ of polygons over a lattice, with seams of uv and normals, groups, materials, perhaps colours."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    has_uv, has_normals, has_colors, has_groups = (draw(st.booleans()) for _ in range(4))
    side = draw(st.integers(2, 4))
    lines = ["mtllib a.mtl"]
    for k in range(side * side):
        color = " 1 0.5 0.25" if has_colors and k % 2 else ""
        lines.append(f"v {k % side} {k // side} {random.integers(0, 3) / 2}{color}")
    lines += [f"vt {u / 4} {v / 8}" for u, v in random.integers(-4, 9, (5, 2))]
    lines += ["vn 1 0 0", "vn 0 1 0", "vn 0 0 1", "vn 0 3 4", "vn 2 0 0"]
    for _ in range(draw(st.integers(1, 9))):
        if has_groups and random.random() < 0.4:
            lines.append(f"{random.choice(['g', 'usemtl', 's'])} {random.choice(['1', 'two', 'off'])}")
        i, j = random.integers(1, side, 2)
        quad = [(j - 1) * side + i, (j - 1) * side + i + 1, j * side + i + 1, j * side + i]
        words = []
        for vertex in quad[: random.choice([3, 4])]:
            uv = str(random.integers(1, 6)) if has_uv and random.random() < 0.9 else ""
            normal = f"/{random.integers(1, 6)}" if has_normals and random.random() < 0.9 else ""
            words.append(f"{vertex}/{uv}{normal}".rstrip("/"))
        lines.append(f"f {' '.join(words)}")
    return "\n".join(lines) + "\n"


def corner_rows(mesh: Mesh, w: NDArray[np.float32]) -> dict[str, NDArray[np.float64]]:
    """Values of each corner by name, (C, k); normals and uv are NaN where a corner has none."""
    rows = {"position": mesh.vertices[mesh.corners], "w": np.asarray(w, np.float64).reshape(-1, 1)}
    if mesh.uvs is not None and mesh.corner_uvs is not None:
        rows["uv"] = np.where(mesh.corner_uvs[:, None] >= 0, mesh.uvs[mesh.corner_uvs], np.nan)
    if mesh.normals is not None and mesh.corner_normals is not None:
        length = np.linalg.norm(mesh.normals, axis=1, keepdims=True)
        unit = mesh.normals / np.where(length > 0, length, 1)
        rows["normal"] = np.where(mesh.corner_normals[:, None] >= 0, unit[mesh.corner_normals], np.nan)
    if "color" in mesh.attributes:
        linear = np.asarray(mesh.attributes["color"], np.float64)[mesh.corners]
        rows["color"] = np.rint(255 * to_srgb(linear))  # as a PLY has them
    return rows


def assert_corners_agree(
    before: dict[str, NDArray[np.float64]], after: dict[str, NDArray[np.float64]], names: set[str]
) -> None:
    """Every corner of the one is a corner of the other, by the columns of these names."""
    shared = [name for name in sorted(names) if name in before]
    assert set(shared) <= after.keys()
    one, other = (np.column_stack([rows[name] for name in shared]) for rows in (before, after))
    one, other = (np.unique(each.round(5) + 0.0, axis=0) for each in (one, other))
    equal = (np.abs(one[:, None] - other) < 2e-5) | np.isnan(one[:, None])
    assert equal.all(axis=2).any(axis=1).all()
    assert equal.all(axis=2).any(axis=0).all()


def used(names: tuple[str, ...], ids: NDArray[np.int32] | None) -> set[str]:
    """The names that polygons have, without that of glTF's colours."""
    return set() if ids is None else {names[k] for k in np.unique(ids) if k >= 0} - {"vertex colours"}


def check_outputs(source: Path, folder: Path, several: bool) -> list[Path]:
    """Write values for a mesh to all formats, read these back, and compare. Returns the files."""
    mesh = read_mesh(source)
    has_colors = "color" in mesh.attributes
    written = []
    for kind, split in (("npz", False), ("ply", False), ("ply", True), ("glb", False), ("obj", False)):
        if kind == "obj" and has_colors:
            continue
        out = folder / f"{source.stem}{source.suffix[1:]}{'s' * split}.{kind}"
        work = prepare_bake(BakeJob(source, (out,), BakeSettings(split=split)))
        random = np.random.default_rng(len(mesh.corners))
        w = random.random(len(mesh.vertices)).astype(np.float32)
        at_corners = w[mesh.corners]
        if several:
            at_corners = random.integers(0, 3, len(mesh.corners)).astype(np.float32) / 2
        baked = Baked(
            {"obscurance": w, "standard_error": w / 8},
            {"content": "c", "version": "v"},
            {"obscurance": at_corners, "standard_error": at_corners / 8} if several else {},
        )
        lines = write_outputs(work, [out], baked, BakedTextures())
        if kind == "npz":
            assert np.array_equal(read_npz(out).channels["obscurance"], w)
            continue
        made = read_mesh(out)
        is_split = split or kind == "glb"
        expected = corner_rows(mesh, at_corners if is_split else w[mesh.corners])
        names = {"position", "w", "uv", "normal", "color"}
        if kind == "obj":
            names -= {"color"}
            value = to_srgb(made.attributes["color"][:, 0].astype(np.float64))
        else:
            value = made.attributes["_OBSCURANCE" if kind == "glb" else "obscurance"]
        names -= {name for name in names if any(f": {name}s of" in line for line in lines)}
        assert_corners_agree(expected, corner_rows(made, value[made.corners]), names)
        if kind != "ply":
            assert used(mesh.group_names, mesh.polygon_groups) <= {*made.group_names}
            materials = used(mesh.material_names, mesh.polygon_materials)
            assert materials == {*made.material_names} - {"vertex colours"}
        written.append(out)
    return written


@settings(max_examples=25, phases=[phase for phase in Phase if phase is not Phase.shrink])
@given(text=obj_texts(), several=st.booleans())
def test_corners_keep_what_they_have(text: str, several: bool) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "a.mtl").write_text("newmtl two\nKd 1 0 0\n")
        (folder / "a.obj").write_text(text)
        for source in check_outputs(folder / "a.obj", folder, several):
            check_outputs(source, folder, several)
