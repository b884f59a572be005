"""The files of a bake."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from illumcli.baking.files import add_baked_to_glb, write_baked_glb, write_baked_ply
from illumcli.baking.inputs import BakeWork
from illumcli.baking.split import OutputMeshes, output_meshes
from illumcli.visibility.baked import Baked, write_npz


def write_outputs(work: BakeWork, due: Sequence[Path], baked: Baked) -> tuple[str, ...]:
    """Write the files `due`. Returns a line for each part of the input that one of them lacks."""

    @cache
    def meshes(split: bool) -> OutputMeshes:
        return output_meshes(work.scene.object_names(), work.surfaces.geometry, baked, split)

    return tuple(f"{path.name}: {what}" for path in due for what in _write(path, work, baked, meshes))


def _write(path: Path, work: BakeWork, baked: Baked, meshes: Callable[[bool], OutputMeshes]) -> Sequence[str]:
    """Write one file: the input with the values if both have one format, otherwise a new file.

    Returns the parts of the input that it lacks.
    """
    source, channel, split = work.path, work.settings.channel, work.settings.split
    source_kind, kind = source.suffix.lower(), path.suffix.lower()
    if kind == ".npz":
        write_npz(path, baked)
        return ()
    if kind == ".glb" and source_kind in (".glb", ".gltf"):
        return add_baked_to_glb(path, source, baked, channel)
    if kind == ".ply" and source_kind == ".ply" and not split:
        write_baked_ply(path, [], baked, source, channel)
        return ()
    written = meshes(split or kind == ".glb")
    if kind == ".ply":
        write_baked_ply(path, written.meshes, written.baked, None, channel)
    else:
        write_baked_glb(path, written.meshes, written.baked, channel)
    return written.left_out
