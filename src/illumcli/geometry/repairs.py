"""Repairs: faults of an input that rendering can cope with, counted per class with the first place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, MutableMapping
from pathlib import PurePath
from typing import TypeAlias

from illumcli.records import Value

HARMLESS = frozenset(
    {
        "unused vertices",
        "triangles that only join strips",
        "rows of other elements left out",
    }
)
"""Classes without any visible effect: in the report, printed only with -v, refused under --strict."""

NORMALS_OF_FILE = "objects whose normals' crease or weights are not used: the file has normals, see source"
NO_GRAIN = "objects whose material has a grain that nothing directs: give the object a grain, or its mesh uv"
NO_MATERIAL = "materials that neither the scene nor a library has, drawn as the default"
NOT_ASKED = "materials of mesh files that are not used: write materials: true, or give the object one"
NO_OCCLUSION = "occlusion textures that are not used: name the file as its mesh's obscurance"
APPROXIMATED = frozenset(
    {
        NORMALS_OF_FILE,
        NO_GRAIN,
        NO_MATERIAL,
        NOT_ASKED,
        NO_OCCLUSION,
    }
)
"""Classes that are no fault of a file: printed, and not refused under --strict."""


class Repair(Value):
    """How often something of one class was repaired or left out."""

    count: int
    first: str = ""
    """The place of the first one. While a mesh file is read it is what follows the file's name (``:12`` for a
    line, ``: face 3``, nothing for the file itself), or a place in a file beside it (``a.mtl:3``)."""


Repairs: TypeAlias = Mapping[str, Repair]
"""Class -> how often and where."""


class MeshRepairs(Value):
    """What was wrong with meshes and put right or left out."""

    repairs: Repairs


def note(repairs: MutableMapping[str, Repair], what: str, first: str = "", count: int = 1) -> None:
    """Count `count` more of the class `what`; `first` is kept if it is the first of its class."""
    known = repairs.get(what)
    repairs[what] = Repair(count, first) if known is None else Repair(known.count + count, known.first)


def located(repairs: Repairs, file: str) -> Repairs:
    """The repairs of a mesh file, each place prefixed with the path of its file.

    Parameters
    ----------
    file : str
        Path of the mesh, or the name of a mesh that has no file.
    """
    return {what: Repair(each.count, path_of(each.first, file)) for what, each in repairs.items()}


def path_of(place: str, file: str) -> str:
    """`Repair.first` of a mesh file, with the path of its file."""
    return file + place if place[:1] in ("", ":") else str(PurePath(file).parent / place)


def joined(parts: Iterable[Repairs]) -> Repairs:
    """The repairs of several inputs together: counts are added, the first place of each class is kept."""
    total: dict[str, Repair] = {}
    for repairs in parts:
        for what, each in repairs.items():
            note(total, what, each.first, each.count)
    return total
