"""Repairs of a job's input files: printed, refused with --strict, reported."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from illumcli.errors import InputError
from illumcli.geometry.repairs import APPROXIMATED, HARMLESS, Repairs
from illumcli.render_graph.build_materials import PURPOSES

_TELLING = (
    "repairs",
    "undirected",
    "unnamed",
    "materials",
    "baked",
    *(f"{purpose}_textures" for purpose in PURPOSES),
)
"""Buffers that say what was put right."""


def repair_lines(repairs: Repairs, verbose: bool = True) -> list[str]:
    """A line per class; those of `HARMLESS` only if `verbose`."""
    return [
        f"{what}: {each.count}{f', the first is {each.first}' if each.first else ''}"
        for what, each in repairs.items()
        if verbose or what not in HARMLESS
    ]


def refuse_repairs(place: str, repairs: Repairs) -> None:
    """Raise InputError where anything needs a repair: every class, its count and its first place."""
    wrong = {what: each for what, each in repairs.items() if what not in APPROXIMATED}
    if wrong:
        way = "mend it, or leave --strict out"
        raise InputError([f"{place}: {line}; {way}" for line in repair_lines(wrong)])


def repairs_data(repairs: Repairs) -> dict[str, dict[str, Any]]:
    """What a report says of repairs: class -> count, class -> first place."""
    return {
        "repairs": {what: each.count for what, each in repairs.items()},
        "repairs_first": {what: each.first for what, each in repairs.items() if each.first},
    }


def repairs(shared: Mapping[str, Any]) -> Repairs:
    """What was put right in meshes, their materials, baked values and textures."""
    return {
        what: each for name, made in shared.items() if name in _TELLING for what, each in made.repairs.items()
    }
