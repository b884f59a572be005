"""glTF 2.0, as text with its buffers (.gltf) or in one file (.glb): the triangles of a scene, in world space.

References
----------
The Khronos Group (2021). glTF 2.0 specification, 2.0.1. ISO/IEC 12113:2022. Sections are its own.
"""

from __future__ import annotations

from bisect import bisect_right
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files._polygons import Ints, RawMesh, checked_mesh, starts_of
from illumcli.mesh_files.gltf.document import Document, dicts, open_document, printable, read_json
from illumcli.mesh_files.gltf.materials import Library
from illumcli.mesh_files.gltf.primitives import Part, parts

OBSCURANCE = "_OBSCURANCE"
"""Name of the attribute of baked obscurance."""

FILLED = {"color": 1.0, "alpha": 1.0, OBSCURANCE: 1.0}
"""Values of attributes that a primitive lacks and others have: white and opaque (3.7.2.1), and open."""


def read(path: Path) -> Mesh:
    """The triangles of every node of the file's scene, one primitive after the other, in the nodes' order.

    The mesh is in its rest pose: the transforms of nodes, instances and skins and the default weights of
    morph targets are applied. Primitives without normals are flat (3.7.2.1). `COLOR_0` becomes the attribute
    `color` (and `alpha`), and attributes that begin with an underscore keep their names; those that some
    primitive lacks are left out. Groups are the nodes. `materials` approximate those of the file by a scene's
    models. Repairs and omissions are counted in `repairs`, those of materials in `material_repairs`.
    """
    # All triangles.
    document = open_document(path)
    primitives = list(parts(document))
    if not any(len(part.triangles) for part in primitives):
        why = "; ".join(document.repairs)
        raise InputError(f"{path}: has no faces{f' ({why})' * bool(why)}; export the mesh with its faces")
    sizes = [len(part.vertices) for part in primitives]
    firsts = starts_of(np.array(sizes, np.int64)).tolist()
    triangles = [part.triangles + first for part, first in zip(primitives, firsts, strict=False)]
    corners = np.concatenate([np.empty((0, 3), np.int64), *triangles]).ravel()
    counts = [len(part.triangles) for part in primitives]

    # Normals and uv of each corner; primitives without normals are flat.
    normals, corner_normals = _joined([part.normals for part in primitives], sizes, corners)
    uvs, corner_uvs = _joined([part.uvs.get(0) for part in primitives], sizes, corners)
    flat = np.array([part.normals is None for part in primitives], np.bool_)
    smoothing = np.repeat(np.where(flat, 0, -1), counts) if flat.any() else None

    # Materials by number, groups by name.
    library = Library(document, primitives)
    material_names, materials = _numbered([library.name(part) for part in primitives])
    group_names, groups = _numbered([part.group for part in primitives])
    attributes = _shared(document, primitives)
    raw = RawMesh(
        np.concatenate([np.empty((0, 3)), *(part.vertices for part in primitives)]),
        corners,
        np.full(len(corners) // 3, 3),
        normals=normals,
        corner_normals=corner_normals,
        uvs=uvs,
        corner_uvs=corner_uvs,
        material_names=material_names,
        polygon_materials=np.repeat(materials, counts) if material_names else None,
        group_names=group_names,
        polygon_groups=np.repeat(groups, counts),
        polygon_smoothing=smoothing,
        attributes={**attributes, **library.coordinates()},
        materials=library.materials,
        substitutes=library.substitutes,
        occlusion={} if OBSCURANCE in attributes and not _bakes_textures(document) else library.occlusion,
        material_repairs=library.repairs,
        repairs=document.repairs,
    )
    place = partial(_place, primitives, firsts, starts_of(np.array(counts)).tolist())
    return checked_mesh(path, raw, place)


def _bakes_textures(document: Document) -> bool:
    """True if illum baked values at vertices together with the occlusion textures, which are finer; otherwise
    the values are newer."""
    about: Any = document.json
    for key in ("asset", "extras", "illum", "parameters", "texture"):
        about = about.get(key) if isinstance(about, dict) else None
    return about is not None


def holds_obscurance(path: Path) -> bool:
    """True if a primitive has baked obscurance, or a material an occlusion texture."""
    parsed = read_json(path)
    meshes, materials = (parsed.get(kind) for kind in ("meshes", "materials"))
    primitives = [each for mesh in dicts(meshes) for each in dicts(mesh.get("primitives"))]
    return any(OBSCURANCE in (each.get("attributes") or {}) for each in primitives) or any(
        isinstance(each.get("occlusionTexture"), dict) for each in dicts(materials)
    )


def _place(primitives: list[Part], vertices: list[int], faces: list[int], part: str, number: int) -> str:
    """The place of a part of the mesh in the file: its primitive, and its number there from 1."""
    first = faces if part == "face" else vertices
    k = bisect_right(first, number, hi=len(primitives)) - 1
    where = f"meshes[{primitives[k].mesh}].primitives[{primitives[k].primitive}]"
    return f": {where}, {part} {number - first[k] + 1}"


def _joined(
    tables: list[NDArray[np.float64] | None], sizes: list[int], corners: Ints
) -> tuple[NDArray[np.float64] | None, Ints | None]:
    """The tables one after the other, and each corner's row, -1 if its part has no table."""
    width = next((table.shape[1] for table in tables if table is not None), None)
    if width is None:
        return None, None
    if all(table is not None for table in tables):
        return np.concatenate([table for table in tables if table is not None]), corners
    filled = [
        np.zeros((size, width)) if table is None else table for table, size in zip(tables, sizes, strict=True)
    ]
    present = np.repeat([table is not None for table in tables], sizes)
    return np.concatenate(filled), np.where(present[corners], corners, -1)


def _numbered(names: list[str | None]) -> tuple[tuple[str, ...], Ints]:
    """The distinct names in order, and the number of each of `names` among them, -1 for none."""
    numbers: dict[str | None, int] = {name: i for i, name in enumerate(dict.fromkeys(n for n in names if n))}
    distinct = tuple(name for name in numbers if name)
    return distinct, np.array([numbers.get(name, -1) for name in names], np.int64)


def _shared(document: Document, primitives: list[Part]) -> dict[str, NDArray[Any]]:
    """The attributes that all parts have in the same width, concatenated; missing colours are filled in."""
    shared = {}
    for name in sorted({name for part in primitives for name in part.attributes}):
        known = [part.attributes.get(name) for part in primitives]
        shapes = {table.shape[1:] for table in known if table is not None}
        if len(shapes) > 1 or (name not in FILLED and any(table is None for table in known)):
            what = f"attribute {printable(name)} that some primitives lack or have otherwise, left out"
            document.count(what)
            continue
        (shape,) = shapes
        shared[name] = np.concatenate(
            [
                np.full((len(part.vertices), *shape), FILLED.get(name, 0), np.float32)
                if table is None
                else table
                for part, table in zip(primitives, known, strict=True)
            ]
        )
    return shared
