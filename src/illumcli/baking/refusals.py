"""What a bake refuses before any ray is cast: outputs and settings that contradict each other."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from illumcli.atlas.unwrap import refuse_missing_library
from illumcli.baking.files import ASSETS, SUFFIXES
from illumcli.baking.settings import BakeSettings
from illumcli.baking.texture_slots import SUFFIXES as TEXTURE_SUFFIXES
from illumcli.baking.texture_slots import Slot, is_texture
from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.scene.scene_file import SceneFile


def refuse_outputs(outputs: Sequence[Path]) -> None:
    """Raise InputError for unknown suffixes and files named twice."""
    known = (*SUFFIXES, *TEXTURE_SUFFIXES)
    problems = [
        f"{each}: no writer for '{each.suffix}' files; use one of {', '.join(known)}"
        for each in outputs
        if each.suffix.lower() not in known
    ]
    if len({os.path.abspath(each) for each in outputs}) < len(outputs):
        problems.append("an output is named twice; give each file once")
    if problems:
        raise InputError(problems)


def refuse_textures(outputs: Sequence[Path], settings: BakeSettings) -> None:
    """Raise InputError for textures without a size, and for a size without textures."""
    files = [each for each in outputs if is_texture(each)]
    if files and settings.texture is None:
        raise InputError(f"{files[0]}: is a texture; give its size, as in --texture 1024")
    if settings.texture is None:
        if settings.unwrap is not None:
            raise InputError("--unwrap makes uv for textures; give their size, as in --texture 1024")
        return
    if settings.unwrap is not None:
        refuse_missing_library()
    assets = [each for each in outputs if each.suffix.lower() == ".glb"]
    if not files and not assets:
        raise InputError("--texture belongs to .png, .exr and .glb outputs; name one with -o")
    if assets and "ao" not in settings.what:
        raise InputError(f"{assets[0]}: the textures of a GLB hold ao; add it to --what")


def refuse_lost_colors(outputs: Sequence[Path], meshes: Sequence[Mesh], settings: BakeSettings) -> None:
    """Raise InputError for an OBJ that has no place for values, because its vertices have colours."""
    files = [each for each in outputs if each.suffix.lower() == ".obj"]
    if files and settings.color is None and any("color" in mesh.attributes for mesh in meshes):
        raise InputError(
            f"{files[0]}: the vertices have colours, which an OBJ would hold in place of values; "
            "choose a channel with --color, or bake to .npz"
        )
    if files and "ao" not in settings.what:
        raise InputError(f"{files[0]}: an OBJ holds ao; add it to --what")


def refuse_color(outputs: Sequence[Path], settings: BakeSettings) -> None:
    """Raise InputError for a change of colours without values, or without files that have colours."""
    if settings.color is None:
        return
    if "ao" not in settings.what:
        raise InputError(f"--color {settings.color}: writes ao; add it to --what")
    if not any(each.suffix.lower() in ASSETS for each in outputs):
        raise InputError(f"--color {settings.color}: belongs to outputs with colours, {', '.join(ASSETS)}")


def refuse_missing_uv(place: str, slots: Sequence[Slot], meshes: Sequence[Mesh]) -> None:
    """Raise InputError for objects that textures are baked of and that have no uv."""
    problems = [
        f"{place}: {slot.object_name} has no uv, which textures need; --unwrap missing makes them"
        for slot in slots
        if meshes[slot.object].uvs is None
    ]
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def refuse_inputs(inputs: Sequence[SceneFile], place: str) -> None:
    """Raise LimitError if meshes do not fit into memory together."""
    total: Counter[str] = Counter()
    for loaded in inputs:
        total.update(expected_memory(loaded, loaded.scene, shares_meshes=False))
    total.pop("textures", None)  # no bake reads them
    refuse_memory(0, 0, 0, total, place)
