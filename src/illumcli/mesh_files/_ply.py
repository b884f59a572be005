"""Parses a PLY file into tables without interpreting them: its header, rows of text, binary rows.

Only binary rows with lists of different lengths need a loop in Python; everything else is a few numpy calls
on whole columns. No memory is allocated for rows that the file cannot contain. `plyfile` loops over every row
and trusts the header. 501,264 vertices, processor seconds, best of three (Python 3.11, numpy 2.4)::

                                                       here    plyfile 1.1.5
    text, 999,698 triangles                            2.1     22
    binary, 999,698 triangles                          0.06    5.8
    binary, 999,698 triangles, 499,849 quadrangles     1.4     9.2
"""

from __future__ import annotations

import re
import struct
from dataclasses import field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files._companions.ply import END, LONGEST_HEADER
from illumcli.mesh_files._polygons import Ints, runs
from illumcli.mesh_files._text import BYTE_ORDER_MARK, Block, Text
from illumcli.mesh_files._words import decoded
from illumcli.records import Value

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("long", "int64"), "i8"),
    **dict.fromkeys(("ulong", "uint64"), "u8"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_START = re.compile(rb"(?:\xef\xbb\xbf)?ply[ \t]*(\r\n|\n|\r)")


class Lists(Value):
    """A list property: the values of all rows one after the other, and their number in each row."""

    values: NDArray[Any]
    counts: Ints


Column: TypeAlias = NDArray[Any] | Lists
Table: TypeAlias = dict[str, Column]


class Property(Value):
    """One property of an element."""

    name: str
    type: np.dtype[Any]
    count_type: np.dtype[Any] | None  # of a list's length; None for a single value
    line: int = 0  # of the header


class Element(Value):
    """The header's declaration of an element: name, number of rows and properties."""

    name: str
    count: int
    properties: list[Property]
    line: int = 0


class Header(Value):
    """The header of a file."""

    elements: list[Element]
    is_text: bool
    start: int  # offset of the first row
    textures: list[tuple[str, int]] = field(default_factory=list)  # images named in comments, and their lines


def header(path: Path, data: bytes, repairs: dict[str, Repair]) -> Header:
    """Parse the header; lines that do not concern the rows are left out."""
    # Its extent.
    begin = _START.match(data)
    end = END.search(data, 0, LONGEST_HEADER)
    if begin is None or end is None:
        raise InputError(f"{path}: has no PLY header; give the file the suffix of its format")
    if data.startswith(BYTE_ORDER_MARK):
        note(repairs, "byte order marks left out", ":1")

    # Its lines.
    order = None
    elements: list[Element] = []
    textures = []
    for number, line in enumerate(data[: end.start()].splitlines()[1:], start=2):
        words = decoded(line).split()
        place = f"{path}:{number}"
        if line[:1].isspace() and words:
            note(repairs, "blanks before lines of the header", f":{number}")
        match words:
            case ["comment", word, _, *_] if word.lower() == "texturefile":
                textures.append((decoded(line).split(None, 2)[2].rstrip(), number))
            case [] | ["comment", *_] | ["obj_info", *_]:
                pass
            case ["format", name, *_] if name in _ORDERS:
                order = name
            case ["element", name, count, *_] if count.isdecimal() and len(count) < 20:
                if name in (element.name for element in elements):
                    raise InputError(f"{place}: element '{name}' is announced twice; export the mesh again")
                elements.append(Element(name, int(count), [], number))
            case ["property", *rest] if elements and (prop := _property(rest, number)):
                known = [each.name for each in elements[-1].properties]
                if prop.name in known:
                    note(repairs, "properties named twice, renamed", f":{number}")
                    prop = replace(prop, name=_unused(prop.name, known))
                elements[-1].properties.append(prop)
                if prop.count_type is not None and prop.count_type.kind == "f":
                    note(repairs, "lengths of lists in floats", f":{number}")
            case ["format" | "element" | "property", *_]:
                text = f"'{decoded(line).strip():.60}'"
                raise InputError(f"{place}: {text} is no line of a PLY header; export the mesh again")
            case _:
                note(repairs, "unknown lines of the header left out", f":{number}")

    if order is None:
        raise InputError(f"{path}: its header has no format line; export the mesh again")
    for element in elements:
        if element.count and not element.properties:
            raise InputError(f"{path}: element '{element.name}' has no properties; export the mesh again")
    # if lines end with a carriage return alone, a line feed after it is the first byte of the rows
    start = end.end(1) if begin[1] != b"\r" else end.start(1) + 1
    return Header([_ordered(each, order) for each in elements], order == "ascii", start, textures)


def _property(words: list[str], line: int) -> Property | None:
    match words:
        case ["list", length, kind, name, *_] if length.lower() in _TYPES and kind.lower() in _TYPES:
            return Property(name, np.dtype(_TYPES[kind.lower()]), np.dtype(_TYPES[length.lower()]), line)
        case [kind, name, *_] if kind.lower() in _TYPES:
            return Property(name, np.dtype(_TYPES[kind.lower()]), None, line)
    return None


def _ordered(element: Element, order: str) -> Element:
    """The element with its types in the byte order of the file."""

    def typed(kind: np.dtype[Any]) -> np.dtype[Any]:
        return kind.newbyteorder(_ORDERS[order])  # type: ignore[arg-type]

    return replace(
        element,
        properties=[
            replace(
                each,
                type=typed(each.type),
                count_type=None if each.count_type is None else typed(each.count_type),
            )
            for each in element.properties
        ],
    )


def _unused(name: str, known: list[str]) -> str:
    return next(new for k in range(2, len(known) + 3) if (new := f"{name}_{k}") not in known)


def tables(
    path: Path, data: bytes, head: Header, repairs: dict[str, Repair]
) -> tuple[dict[str, Table], Text | None]:
    """Element -> property -> values, and the text that contains them; None for binary files.

    Numbers in text are float64, whatever their type. A row of text is a line, and surplus words are left out.
    If lines do not fit the rows, the text is read as a sequence of values, and None is returned for it.
    """
    if not head.is_text:
        columns, end = _binary_tables(path, data, head.elements, head.start)
        if data[end:].strip():
            note(repairs, "bytes behind the last row left out", f": byte {end + 1}", len(data) - end)
        return columns, None
    text = Text.of(path, data)
    repairs.update(text.repairs)
    lines = np.flatnonzero(text.starts >= head.start)
    try:
        return _by_lines(path, text, lines, head.elements, repairs), text
    except InputError as error:
        values = _by_values(path, text.block(lines).floats(), head.elements)
        if values is None:
            raise error from None
        note(repairs, "rows that are no lines, read value by value", f":{text.number(int(lines[0]))}")
        return values, None


def _by_values(path: Path, values: NDArray[np.float64], elements: list[Element]) -> dict[str, Table] | None:
    """The tables if rows are not lines but the number of values is as declared; otherwise None."""
    data = values.tobytes()
    try:
        columns, end = _binary_tables(path, data, [_of_doubles(each) for each in elements], 0)
    except InputError:
        return None
    return columns if end == len(data) else None


def _of_doubles(element: Element) -> Element:
    double = np.dtype("f8")
    return replace(
        element,
        properties=[
            replace(each, type=double, count_type=None if each.count_type is None else double)
            for each in element.properties
        ],
    )


def _by_lines(
    path: Path, text: Text, lines: NDArray[np.intp], elements: list[Element], repairs: dict[str, Repair]
) -> dict[str, Table]:
    announced = sum(element.count for element in elements)
    if announced > len(lines):
        raise InputError(
            f"{path}: announces {announced} rows and has {len(lines)} lines of them; export the mesh again"
        )
    columns = {}
    first = 0
    behind: dict[str, Repair] = {}
    for element in elements:
        columns[element.name] = _lines_of(text.block(lines[first : first + element.count]), element, behind)
        first += element.count
    if len(lines) > announced:
        place = f":{text.number(int(lines[announced]))}"
        note(behind, "lines behind the last row left out", place, len(lines) - announced)
    repairs.update(behind)
    return columns


def _lines_of(block: Block, element: Element, repairs: dict[str, Repair]) -> Table:
    """The table of one element with a row per line; NaN where a word is not a number."""
    values, ends = block.floats(needed=0), np.cumsum(block.counts)
    at = ends - block.counts

    def check(wrong: NDArray[np.bool_], fact: str) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(f"{block.place(row)}: {element.name} {row} {fact}; export the mesh again")

    # `at` is each row's next word; a list advances it by a different number of words in each row.
    table: Table = {}
    for each in element.properties:
        check(at >= ends, f"has no value for '{each.name}'")
        if each.count_type is None:
            table[each.name] = values[at]
            at = at + 1
            continue
        counts = values[at]
        valid = (counts >= 0) & (counts == np.floor(counts)) & (counts <= ends - at - 1)
        check(~valid, f"has fewer values in '{each.name}' than it announces")
        counts = counts.astype(np.int64)
        table[each.name] = Lists(values[runs(at + 1, counts)], counts)
        at = at + 1 + counts
    longer = at != ends
    if longer.any():
        place = f":{block.text.number(int(block.lines[np.argmax(longer)]))}"
        note(repairs, "values behind the end of a row left out", place, int(np.count_nonzero(longer)))
    return table


def _binary_tables(
    path: Path, data: bytes, elements: list[Element], start: int
) -> tuple[dict[str, Table], int]:
    """Element -> property -> values of binary rows, and the offset of their end."""
    columns = {}
    for element in elements:
        columns[element.name], start = _binary_table(path, data, element, start)
    return columns, start


def _binary_table(path: Path, data: bytes, element: Element, start: int) -> tuple[Table, int]:
    """Property -> values of the element whose rows begin at `start`, and the offset of their end."""
    least = sum((each.count_type or each.type).itemsize for each in element.properties)
    if element.count * least > len(data) - start:
        raise _cut_off(path, element, (len(data) - start) // max(least, 1))
    if not element.count:
        empty = np.empty(0, np.int64)
        return {
            each.name: np.empty(0, each.type)
            if each.count_type is None
            else Lists(np.empty(0, each.type), empty)
            for each in element.properties
        }, start
    return _equal_rows(data, element, start) or _ragged_rows(path, data, element, start)


def _equal_rows(data: bytes, element: Element, start: int) -> tuple[Table, int] | None:
    """The table if the lists of all rows have the lengths of those in the first row, otherwise None."""
    # The layout of the first row.
    fields: list[Any] = []
    at = start
    for i, each in enumerate(element.properties):
        if each.count_type is None:
            fields.append((f"value {i}", each.type))
            at += each.type.itemsize
            continue
        if at + each.count_type.itemsize > len(data):
            return None
        size = _whole(np.frombuffer(data, each.count_type, 1, at)[0])
        at += each.count_type.itemsize + max(size, 0) * each.type.itemsize
        if size < 0 or at > len(data):
            return None
        fields += [(f"count {i}", each.count_type), (f"value {i}", each.type, (size,))]

    # All rows by this layout; give up if a length differs.
    end = start + element.count * (at - start)
    if end > len(data):
        return None
    rows = np.frombuffer(data, np.dtype(fields), element.count, start)
    table: Table = {}
    for i, each in enumerate(element.properties):
        values = rows[f"value {i}"]
        if each.count_type is None:
            table[each.name] = values
            continue
        counts = rows[f"count {i}"]
        if (counts != counts[0]).any():
            return None
        table[each.name] = Lists(values.reshape(-1), counts.astype(np.int64))
    return table, end


def _whole(number: Any) -> int:
    """The length of a list; -1 if the number is not a valid length."""
    return int(number) if 0 <= number < 2**53 and number == int(number) else -1


def _ragged_rows(path: Path, data: bytes, element: Element, start: int) -> tuple[Table, int]:
    """The table of rows of different lengths."""
    at, end = _row_starts(path, data, element, start)
    raw = np.frombuffer(data, np.uint8)
    table: Table = {}
    for each in element.properties:
        if each.count_type is None:
            table[each.name] = _gathered(raw, at, each.type)
            at = at + each.type.itemsize
            continue
        counts = _gathered(raw, at, each.count_type).astype(np.int64)
        at = at + each.count_type.itemsize
        table[each.name] = Lists(_gathered(raw, runs(at, counts, each.type.itemsize), each.type), counts)
        at = at + counts * each.type.itemsize
    return table, end


def _row_starts(path: Path, data: bytes, element: Element, start: int) -> tuple[Ints, int]:
    """(count,) offset of each row, and of the end of the last; the only loop over rows."""
    # A row's layout: each list with the bytes of the scalars before it, and the bytes after the last.
    steps: list[tuple[int, struct.Struct, int]] = []  # bytes before a list, its length, bytes of an item
    gap = 0
    for each in element.properties:
        if each.count_type is None:
            gap += each.type.itemsize
        else:
            steps.append((gap, _struct(each.count_type), each.type.itemsize))
            gap = 0
    # The size of a row is known only after reading the lengths of its lists.
    starts = []
    at = start
    for row in range(element.count):
        starts.append(at)
        for before, length, size in steps:
            at += before
            try:
                (length_of_list,) = length.unpack_from(data, at)
            except struct.error:
                raise _cut_off(path, element, row) from None
            if (count := _whole(length_of_list)) < 0:
                place = f"{path}: {element.name} {row}"
                raise InputError(f"{place} announces a list of {length_of_list}; export the mesh again")
            at += length.size + size * count
        at += gap
    if at > len(data):
        raise _cut_off(path, element, element.count - 1)
    return np.array(starts, np.int64), at


def _struct(kind: np.dtype[Any]) -> struct.Struct:
    order = kind.str[0].replace("|", "<").replace("=", "<")
    letter = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}
    return struct.Struct(order + letter.get(kind.str[1:], kind.char))


def _gathered(raw: NDArray[np.uint8], starts: Ints, kind: np.dtype[Any]) -> NDArray[Any]:
    """(N,) the value of type `kind` that begins at each of `starts`."""
    return raw[starts[:, None] + np.arange(kind.itemsize)].view(kind).reshape(-1)


def _cut_off(path: Path, element: Element, row: int) -> InputError:
    return InputError(
        f"{path}: announces {element.count} of element '{element.name}' and ends before number {row + 1}; "
        "the file is cut off, export it again"
    )
