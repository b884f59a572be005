"""The files of a bake."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

from illumcli.baking.files import add_baked_to_glb, write_baked_glb, write_baked_ply
from illumcli.baking.inputs import BakeWork
from illumcli.baking.split import OutputMeshes, output_meshes
from illumcli.visibility.baked import Baked, write_npz

GlbParts: TypeAlias = tuple[tuple[dict[str, Any], bytes], list[tuple[int, int, int]]]
"""JSON and binary chunk of a GLB, and (mesh, primitive, vertices) in the order of its reader."""


def write_outputs(work: BakeWork, due: Sequence[Path], baked: Baked) -> tuple[str, ...]:
    """Write the files `due`. Returns a line for each part of the meshes that they lack."""
    left_out: list[str] = []

    @cache
    def meshes(split: bool) -> OutputMeshes:
        written = output_meshes(work.scene.object_names(), work.surfaces.geometry, baked, split)
        left_out.extend(written.left_out)
        return written

    for path in due:
        _write(path, work, baked, meshes)
    return tuple(left_out)


def _write(path: Path, work: BakeWork, baked: Baked, meshes: Callable[[bool], OutputMeshes]) -> None:
    """Write one file: a copy of the input with the values if both have one format, otherwise a new file."""
    source, channel, split = work.path, work.settings.channel, work.settings.split
    source_kind, kind = source.suffix.lower(), path.suffix.lower()
    if kind == ".npz":
        write_npz(path, baked)
    elif kind == ".ply" and source_kind == ".ply" and not split:
        write_baked_ply(path, [], baked, source, channel)
    elif kind == ".ply":
        written = meshes(split)
        write_baked_ply(path, written.meshes, written.baked, None, channel)
    elif source_kind == ".glb" and channel is None and (parts := glb_parts(source)):
        add_baked_to_glb(path, *parts, baked)
    else:
        written = meshes(True)
        write_baked_glb(path, written.meshes, written.baked, channel)


def glb_parts(path: Path) -> GlbParts | None:
    """The parts of a GLB that values are added to; None if a mesh is placed twice, or the first buffer is not
    in the file."""
    from illumcli.mesh_files.gltf import primitives_of
    from illumcli.mesh_files.gltf.document import open_document

    document = open_document(path)
    primitives = primitives_of(document)
    once = len({each[:2] for each in primitives}) == len(primitives)
    if not once or (document.items("buffers") and "uri" in document.item("buffers", 0)):
        return None
    return (document.json, document.chunk or b""), primitives
