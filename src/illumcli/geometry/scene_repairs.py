"""Repairs and omissions in the meshes of a scene; each mesh counts once."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import (
    NO_GRAIN,
    NO_MATERIAL,
    NO_OCCLUSION,
    NORMALS_OF_FILE,
    NOT_ASKED,
    MeshRepairs,
    Repair,
    joined,
    located,
    note,
)


def repairs(names: Sequence[str], computes: Sequence[bool], meshes: Sequence[Mesh]) -> MeshRepairs:
    """The repairs of all meshes.

    Parameters
    ----------
    names : sequence of str
        Name of each object's mesh in messages: its file as the scene names it, or the object.
    computes : sequence of bool
        True for objects whose scene says how normals are computed if the file has none.
    """
    of_meshes = {id(mesh): located(mesh.repairs, name) for name, mesh in zip(names, meshes, strict=True)}
    together = dict(joined(of_meshes.values()))
    for name, is_computed, mesh in zip(names, computes, meshes, strict=True):
        index = mesh.corner_normals
        if is_computed and index is not None and len(index) and (index >= 0).all():
            note(together, NORMALS_OF_FILE, name)
    return MeshRepairs(together)


def undirected(names: Sequence[str], wants: Sequence[bool], meshes: Sequence[Mesh]) -> MeshRepairs:
    """Objects whose material has a grain of unknown direction; `wants` marks those that need uv for it."""
    without_uv: dict[str, Repair] = {}
    for name, wants_uv, mesh in zip(names, wants, meshes, strict=True):
        if wants_uv and mesh.uvs is None and mesh.polygon_count:
            note(without_uv, NO_GRAIN, name)
    return MeshRepairs(without_uv)


def unnamed(
    names: Sequence[str],
    selects: Sequence[tuple[tuple[str, ...], bool] | None],
    has_obscurance: Sequence[bool],
    meshes: Sequence[Mesh],
) -> MeshRepairs:
    """Materials that mesh files select by name, but which do not exist or are not imported, and occlusion
    textures of imported ones that are not used.

    Parameters
    ----------
    selects : sequence
        For each object the materials of the scene that its mesh selects from, and whether it imports those
        of its file; None for objects with one material.
    has_obscurance : sequence
        For each object, True if its obscurance is read from a file.
    """
    unknown: dict[str, Repair] = {}
    for name, selected, has_file, mesh in zip(names, selects, has_obscurance, meshes, strict=True):
        known, imports = selected or ((), False)
        if imports and mesh.occlusion and not has_file:
            note(unknown, NO_OCCLUSION, name, len(mesh.occlusion))
        missing = set(mesh.material_names) - set(known)
        # Materials missing in a library are among the repairs of its mesh already.
        if selected is None or not missing or (imports and mesh.materials):
            continue
        note(unknown, NOT_ASKED if missing & mesh.materials.keys() else NO_MATERIAL, name, len(missing))
    return MeshRepairs(unknown)
