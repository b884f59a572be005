"""Tables of numbers in a glTF document: accessors, dense, sparse or of zeros (specification, 3.6.2, 5.1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import LimitError
from illumcli.mesh_files.gltf.document import Document, is_index

MOST_ZEROS = 1 << 24
"""Most rows of an accessor without data, which the size of the file does not limit."""

_TYPES = {
    5120: "i1",
    5121: "u1",
    5122: "<i2",
    5123: "<u2",
    5124: "<i4",
    5125: "<u4",
    5126: "<f4",
    5130: "<f8",
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def table(document: Document, index: Any, widths: tuple[int, ...], fractions: bool = False) -> NDArray[Any]:
    """(count, width) values of an accessor in the file's type; normalized integers become fractions.

    Parameters
    ----------
    widths : tuple of int
        Allowed numbers per row.
    fractions : bool
        True: integers are normalized, whether the accessor says so or not.

    Raises
    ------
    InputError
        An accessor that does not exist, has another type, or whose data are missing.
    """
    values = stored(document, index, widths)
    entry = document.item("accessors", index)
    if values.dtype.kind in "iu" and (fractions or entry.get("normalized") is True):
        return np.maximum(values / np.iinfo(values.dtype).max, -1)
    return values


def stored(document: Document, index: Any, widths: tuple[int, ...]) -> NDArray[Any]:
    """(count, width) values of an accessor as they are stored, not as fractions; errors as in `table`."""
    entry, where = document.item("accessors", index), f"accessors[{index}]"
    kind, shape = entry.get("componentType"), entry.get("type")
    width = _WIDTHS.get(shape) if isinstance(shape, str) else None
    if not is_index(kind) or kind not in _TYPES or width not in widths:
        raise document.wrong(
            f"{where} is of type {shape!r:.20} of {kind!r:.20}, which is not fit for its use"
        )
    dtype = np.dtype(_TYPES[kind])
    count = document.integer(entry, "count", where)

    # The dense rows, or zeros, which take no memory.
    if has_rows := "bufferView" in entry:
        start = document.integer(entry, "byteOffset", where, 0)
        values = _rows(document, entry["bufferView"], start, (count, width), dtype, where)
    elif count > MOST_ZEROS:
        raise LimitError(
            f"{document.path}: {where} has {count} rows and no data, the limit is {MOST_ZEROS}; "
            "use a smaller mesh"
        )
    else:
        values = np.broadcast_to(np.zeros(1, dtype), (count, width))

    # The rows that a sparse accessor replaces.
    if "sparse" in entry:
        rows, replaced = _sparse(document, entry["sparse"], values, where)
        values = values.copy() if has_rows else np.zeros((count, width), dtype)
        values[rows] = replaced
    return values


def has_data(document: Document, index: Any) -> bool:
    """True if an accessor has data, False if it is all zeros."""
    entry = document.item("accessors", index)
    return "bufferView" in entry or "sparse" in entry


def _sparse(
    document: Document, sparse: Any, values: NDArray[Any], where: str
) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """(S,) numbers of rows and their (S, width) values."""
    indices, rows = (sparse.get(key) if isinstance(sparse, dict) else None for key in ("indices", "values"))
    if not isinstance(indices, dict) or not isinstance(rows, dict):
        raise document.wrong(f"{where}.sparse has no indices and values")
    count = document.integer(sparse, "count", f"{where}.sparse")
    kind = indices.get("componentType")
    if kind not in (5121, 5123, 5125):
        raise document.wrong(f"{where}.sparse.indices are of type {kind!r:.20}, which is no whole number")
    arrays = []
    for part, shape, dtype in (
        (indices, (count, 1), np.dtype(_TYPES[kind])),
        (rows, (count, values.shape[1]), values.dtype),
    ):
        start = document.integer(part, "byteOffset", f"{where}.sparse", 0)
        arrays.append(_rows(document, part.get("bufferView"), start, shape, dtype, f"{where}.sparse"))
    numbers = arrays[0][:, 0].astype(np.int64)
    if len(numbers) and numbers.max() >= len(values):
        raise document.wrong(f"{where}.sparse replaces row {numbers.max()} of {len(values)}")
    return numbers, arrays[1]


def _rows(
    document: Document,
    view: Any,
    offset: int,
    shape: tuple[int, int],
    dtype: np.dtype[Any],
    where: str,
) -> NDArray[Any]:
    """Rows that begin `offset` bytes into a buffer view, with the view's stride."""
    buffer, start, end = document.view(view)
    count, width = shape
    size = width * dtype.itemsize
    stride = document.integer(document.item("bufferViews", view), "byteStride", f"bufferViews[{view}]", 0)
    stride = stride or size
    start += offset
    if count and (start + (count - 1) * stride + size > end or stride < size):
        raise document.wrong(f"{where} reaches beyond its buffer view")
    if not count:
        return np.empty(shape, dtype)
    return np.ndarray(shape, dtype, buffer, start, (stride, dtype.itemsize))
