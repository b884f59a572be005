"""Repairs of a scene's input files: as lines, as an error with --strict, as data of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from illumcli.errors import InputError
from illumcli.geometry.repairs import APPROXIMATED, HARMLESS, Repairs
from illumcli.layers import Layer
from illumcli.render_graph.build import Graph
from illumcli.render_graph.build_materials import PURPOSES
from illumcli.render_graph.schedule import reached

_WITH_REPAIRS = (
    "repairs",
    "undirected",
    "unnamed",
    "materials",
    "baked",
    *(f"{purpose}_textures" for purpose in PURPOSES),
)
"""Buffers whose values have `repairs`."""


def repair_lines(repairs: Repairs, verbose: bool = True) -> list[str]:
    """One line per kind of repair; those in `HARMLESS` only if `verbose`."""
    return [
        f"{what}: {each.count}{f', the first is {each.first}' if each.first else ''}"
        for what, each in repairs.items()
        if verbose or what not in HARMLESS
    ]


def refuse_repairs(place: str, repairs: Repairs) -> None:
    """Raise InputError if anything needed a repair: every kind, its count and its first place."""
    wrong = {what: each for what, each in repairs.items() if what not in APPROXIMATED}
    if wrong:
        way = "mend it, or leave --strict out"
        raise InputError([f"{place}: {line}; {way}" for line in repair_lines(wrong)])


def repairs_data(repairs: Repairs) -> dict[str, dict[str, Any]]:
    """The entries of a report: kind -> count, kind -> first place."""
    return {
        "repairs": {what: each.count for what, each in repairs.items()},
        "repairs_first": {what: each.first for what, each in repairs.items() if each.first},
    }


def repairs(shared: Mapping[str, Any]) -> Repairs:
    """The repairs of meshes, their materials, baked values and textures."""
    return {
        what: each
        for name, value in shared.items()
        if name in _WITH_REPAIRS
        for what, each in value.repairs.items()
    }


def repairs_of(graph: Graph, outputs: Sequence[Layer]) -> Repairs:
    """The repairs of everything that pictures with these layers read. Reads the files and casts no ray."""
    names = set(reached(graph, outputs))
    buffers: dict[str, Any] = {}
    for node in graph.topological_order([name for name in _WITH_REPAIRS if name in names]):
        buffers[node.output] = node.run(buffers)
    return repairs(buffers)
