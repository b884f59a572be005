"""A PLY file as plyfile writes it, read by this package's parser, which also reads what plyfile refuses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from illumcli.geometry.repairs import Repair
from illumcli.mesh_files._companions.ply import head
from illumcli.mesh_files._files import content
from illumcli.mesh_files._ply import Column, Element, Lists, Property, Table, header, tables
from illumcli.mesh_files._words import decoded

if TYPE_CHECKING:
    from plyfile import PlyData

_BYTE_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}


def read_copy(path: Path) -> PlyData:
    """All elements, properties and comments of a PLY file, with repairs as of a read.

    Raises
    ------
    InputError
        The file is no PLY, or is malformed.
    """
    from plyfile import PlyData

    repairs: dict[str, Repair] = {}
    data = content(path)
    parsed = header(path, data, repairs)
    columns, _ = tables(path, data, parsed, repairs)

    # Comments belong to the element whose declaration they follow, the first ones to the file.
    comments: list[list[str]] = [[]]
    obj_info, order = [], "="
    for line in head(data).splitlines()[1:]:
        word, _, rest = _ascii(decoded(line)).strip().partition(" ")
        if word == "comment":
            comments[-1].append(rest)
        elif word == "obj_info":
            obj_info.append(rest)
        elif word == "element":
            comments.append([])
        elif word == "format":
            order = _BYTE_ORDERS[rest.split()[0]]
    elements = [
        _element(each, columns[each.name], notes)
        for each, notes in zip(parsed.elements, comments[1:], strict=True)
    ]
    return PlyData(elements, parsed.is_text, order, comments[0], obj_info)


def _element(element: Element, columns: Table, comments: list[str]) -> Any:
    from plyfile import PlyElement, PlyListProperty, PlyProperty

    names = {each.name: _ascii(each.name) for each in element.properties}
    kinds = {each.name: _kind(each, columns[each.name]) for each in element.properties}
    table = np.empty(
        element.count,
        [(names[p.name], kinds[p.name] if p.count_type is None else "O") for p in element.properties],
    )
    properties = []
    for each in element.properties:
        column, kind = columns[each.name], kinds[each.name]
        if isinstance(column, Lists):
            rows = np.split(_cast(column.values, kind), np.cumsum(column.counts)[:-1])
            table[names[each.name]] = np.fromiter(rows if element.count else [], object, element.count)
            longest = column.counts.max(initial=0)
            properties.append(PlyListProperty(names[each.name], "u1" if longest < 256 else "i4", kind))
        else:
            table[names[each.name]] = _cast(column, kind)
            properties.append(PlyProperty(names[each.name], kind))
    copy = PlyElement(_ascii(element.name), properties, element.count, comments)
    copy.data = table
    return copy


def _ascii(text: str) -> str:
    """A text with escapes for what a header cannot hold."""
    return text.encode("ascii", "backslashreplace").decode()


def _kind(prop: Property, column: Column) -> str:
    """The type of a property; integers of 64 bits, unknown to plyfile, become narrower or doubles."""
    kind = prop.type.newbyteorder("=")
    if kind.kind not in "iu" or kind.itemsize < 8:
        return kind.str[1:]
    values = column.values if isinstance(column, Lists) else column
    limits = np.iinfo(np.int32)
    fits = limits.min <= values.min(initial=0) and values.max(initial=0) <= limits.max
    return "i4" if fits else "f8"


def _cast(values: Any, kind: str) -> Any:
    """Values of a type; what is not a number is 0 among integers."""
    return values.astype(kind) if kind[0] == "f" else np.nan_to_num(values).astype(kind)
