"""Which textures a bake has, one for every object and material, and the names of their files."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from illumcli.arrays import Ids
from illumcli.errors import InputError
from illumcli.files.names import expand, fields
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.records import Value

SUFFIXES = (".png", ".exr")
FIELDS = ("object", "material")
"""What names of textures may hold beside the name of the input."""
NO_MATERIAL = "none"
"""`{material}` of polygons without one."""


class Slot(Value):
    """The polygons of an object that have one material, and so one texture."""

    object: int
    material: int  # index in the mesh's `material_names`, -1 for none
    object_name: str
    material_name: str

    @property
    def name(self) -> str:
        """What messages call it."""
        material = f", material {self.material_name}" if self.material >= 0 else ""
        return f"{self.object_name}{material}"


def texture_slots(names: Sequence[str], geometry: SceneGeometry) -> tuple[Slot, ...]:
    """The slots of all objects, given by name, that have polygons."""
    slots = []
    for number, (name, placed) in enumerate(zip(names, geometry.placed, strict=True)):
        mesh = placed.mesh
        used = np.zeros(0, np.int32) if mesh.polygon_materials is None else np.unique(mesh.polygon_materials)
        for material in used.tolist() or [-1] * bool(mesh.polygon_count):
            of_mesh = mesh.material_names[material] if material >= 0 else NO_MATERIAL
            slots.append(Slot(number, material, name, of_mesh))
    return tuple(slots)


def slot_triangles(geometry: SceneGeometry, slot: Slot) -> Ids:
    """(T,) int32 numbers of the triangles of a slot, ascending."""
    placed = geometry.placed[slot.object]
    own = np.flatnonzero(geometry.objects == slot.object).astype(np.int32)
    if placed.mesh.polygon_materials is not None:
        material = placed.mesh.polygon_materials[geometry.polygons[own] - placed.first_polygon]
        own = own[material == slot.material]
    return own


def is_texture(path: Path) -> bool:
    """True for files of textures."""
    return path.suffix.lower() in SUFFIXES


class TextureFile(Value):
    """What a file of a texture holds."""

    slot: Slot
    what: tuple[str, ...]  # words of `--what`


def texture_files(
    patterns: Sequence[Path], slots: Sequence[Slot], what: Sequence[str]
) -> Mapping[Path, TextureFile]:
    """The files of textures that patterns name: of `{what}` one for each word, otherwise of all words one.

    Raises
    ------
    InputError
        Several textures would have the same name, or none has one; a PNG would hold several words.
    """
    files: dict[Path, TextureFile] = {}
    problems = []
    for pattern in filter(is_texture, patterns):
        parts = [(word,) for word in what] if "what" in fields(str(pattern)) else [tuple(what)]
        if pattern.suffix.lower() == ".png" and len(parts[0]) > 1:
            better = pattern.with_name(f"{pattern.stem}.{{what}}{pattern.suffix}")
            problems.append(
                f"{pattern}: a PNG holds one of {', '.join(what)}; name them apart, as in {better}"
            )
            continue
        for slot, words in itertools.product(slots, parts):
            named = {"object": slot.object_name, "material": slot.material_name, "what": words[0]}
            path = Path(expand(str(pattern), named))
            if path in files:
                several = {
                    name: len({getattr(each, f"{name}_name") for each in slots}) > 1 for name in FIELDS
                }
                ending = "".join(f".{{{name}}}" for name in FIELDS if several[name])
                better = pattern.with_name(f"{pattern.stem}{ending}{pattern.suffix}")
                problems.append(
                    f"{path}: the name of {len(slots)} textures, one for every object and material; "
                    f"let names differ, as in {better}"
                )
                break
            files[path] = TextureFile(slot, words)
    if problems:
        raise InputError(problems)
    return files
