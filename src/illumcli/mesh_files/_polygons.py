"""From what a file holds to a checked `Mesh`: the last step of every reader."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.mesh_checks import Place, faults, numbered
from illumcli.geometry.repairs import Repair, Repairs, note

LARGEST = 1e18  # of a coordinate: products of two stay in the range of single precision
MOST_CORNERS = 2**31 - 1  # corners are counted in int32

Ints = NDArray[np.int64]


def polygons(
    path: Path,
    vertices: NDArray[np.float64],
    corners: Ints,
    counts: Ints,
    *,
    normals: NDArray[np.float64] | None = None,
    corner_normals: NDArray[Any] | None = None,
    uvs: NDArray[np.float64] | None = None,
    corner_uvs: NDArray[Any] | None = None,
    polygon_materials: NDArray[Any] | None = None,
    polygon_groups: NDArray[Any] | None = None,
    polygon_smoothing: NDArray[Any] | None = None,
    attributes: Mapping[str, NDArray[Any]] | None = None,
    repairs: Repairs | None = None,
    place: Place = numbered,
    **more: Any,
) -> Mesh:
    """The mesh of polygons with `counts` corners each, or `InputError` where it has none or is not finite.

    Polygons of fewer than three corners are dropped. Normals and uv that are not finite, and normals of
    no length, are taken from the corners that use them. Attributes that are not finite become 0, and so do
    vertices that no polygon uses. All of it is counted in the mesh's `repairs`.

    Parameters
    ----------
    vertices : (V, 3) float64
    corners : (C,) int64
        Vertex of each corner, in range.
    counts : (P,) int64
        Corners of each polygon.
    normals, uvs : (K, 3), (U, 2) float64, or None
    corner_normals, corner_uvs : (C,) int, or None
        Row of each corner, -1 for none.
    polygon_materials, polygon_groups, polygon_smoothing : (P,) int, or None
    attributes : (V,) or (V, k) each
    repairs
        What the reader itself put right.
    place
        Where a part of the file stands.
    **more
        Other fields of `Mesh`.
    """
    noted = dict(repairs or {})
    few = counts < 3
    if few.any():
        _count(noted, "faces with fewer than three corners", "face", few, place)
        kept = np.repeat(~few, counts)
        corners, counts = corners[kept], counts[~few]
        corner_normals, corner_uvs = _pick(corner_normals, kept), _pick(corner_uvs, kept)
        polygon_materials, polygon_groups = _pick(polygon_materials, ~few), _pick(polygon_groups, ~few)
        polygon_smoothing = _pick(polygon_smoothing, ~few)
    if not len(counts):
        raise InputError(f"{path}: has no faces; export the mesh with its faces")
    if len(corners) > MOST_CORNERS:
        raise LimitError(
            f"{path}: has {len(corners)} corners, the limit is {MOST_CORNERS}; use a smaller mesh"
        )
    vertices = _finite_vertices(path, vertices, corners, noted, place)
    if normals is not None and corner_normals is not None:
        usable = _within(normals) & normals.any(axis=1)
        corner_normals = _unless(usable, corner_normals)
        _count(noted, "normals not finite or of no length", "normal", ~usable, place)
    if uvs is not None and corner_uvs is not None:
        usable = _within(uvs)
        corner_uvs = _unless(usable, corner_uvs)
        _count(noted, "uv not finite", "uv", ~usable, place)
    mesh = Mesh(
        attributes={name: _finite(name, values, noted, place) for name, values in (attributes or {}).items()},
        vertices=vertices,
        corners=corners.astype(np.int32),
        starts=starts_of(counts).astype(np.int32),
        normals=normals,
        corner_normals=_ids(corner_normals),
        uvs=uvs,
        corner_uvs=_ids(corner_uvs),
        polygon_materials=_ids(polygon_materials),
        polygon_groups=_ids(polygon_groups),
        polygon_smoothing=_ids(polygon_smoothing),
        repairs=noted,
        **more,
    )
    face = np.flatnonzero(~few)
    return replace(
        mesh, repairs=faults(mesh, lambda part, n: place(part, int(face[n]) if part == "face" else n))
    )


def starts_of(counts: NDArray[Any]) -> Ints:
    """(P + 1,) where each of consecutive runs of `counts` entries starts, and the end."""
    return np.concatenate(([0], np.cumsum(counts, dtype=np.int64)))


def runs(starts: NDArray[Any], counts: NDArray[Any], step: int = 1) -> Ints:
    """start, start + step, ... for `counts` entries of each start, one run after the other."""
    within = np.arange(counts.sum(), dtype=np.int64) - np.repeat(starts_of(counts)[:-1], counts)
    return np.repeat(starts, counts) + step * within


def _finite_vertices(
    path: Path, vertices: NDArray[np.float64], corners: Ints, noted: dict[str, Repair], place: Place
) -> NDArray[np.float64]:
    """`vertices`, 0 where one is NaN, infinite or beyond `LARGEST`; refused where a corner uses it."""
    usable = _within(vertices)
    if usable.all():
        return vertices
    used = np.zeros(len(vertices), np.bool_)
    used[corners] = True
    if (bad := np.flatnonzero(used & ~usable)).size:
        raise InputError(
            f"{path}: {len(bad)} of {len(vertices)} vertices are not finite or beyond {LARGEST:g}, the first "
            f"is number {bad[0] + 1}; repair the mesh where it was made"
        )
    _count(noted, "unused vertices that are not finite, made 0", "vertex", ~usable, place)
    return np.where(usable[:, None], vertices, 0.0)


def check_range(indices: Ints, size: int, refuse: Callable[[int], InputError]) -> None:
    """Refuse indices outside 0..size - 1; `refuse` makes the error from the position of the first."""
    if len(indices) and (indices.min() < 0 or indices.max() >= size):
        raise refuse(int(np.argmax((indices < 0) | (indices >= size))))


def strip(indices: NDArray[Any]) -> tuple[Ints, int]:
    """Triangles of strips, and how many were left out because they only join two strips.

    Parameters
    ----------
    indices : (S,) int
        Vertices; -1 ends a strip. Every second triangle of a strip is turned, so all wind alike.

    Returns
    -------
    (T, 3) int64, int
    """
    ids = np.asarray(indices, np.int64)
    triples = np.stack([ids[:-2], ids[1:-1], ids[2:]], axis=1) if len(ids) > 2 else np.empty((0, 3), np.int64)
    place = np.arange(len(ids))
    first = np.maximum.accumulate(np.where(ids == -1, place + 1, 0))[: len(triples)]
    turned = (place[: len(triples)] - first) % 2 == 1
    triples[turned, 0], triples[turned, 1] = triples[turned, 1], triples[turned, 0]
    triangles = triples[(triples != -1).all(axis=1)]
    a, b, c = triangles.T
    proper = (a != b) & (b != c) & (c != a)
    return triangles[proper], int(np.count_nonzero(~proper))


def _within(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.all(np.abs(values) <= LARGEST, axis=1)
    return inside


def _pick(values: NDArray[Any] | None, kept: NDArray[np.bool_]) -> NDArray[Any] | None:
    return None if values is None else values[kept]


def _unless(usable: NDArray[np.bool_], corner_rows: NDArray[Any]) -> NDArray[Any]:
    """`corner_rows` with -1 where the row is not usable."""
    if usable.all():
        return corner_rows
    return np.where(np.append(usable, True)[corner_rows], corner_rows, -1)


def _finite(name: str, values: NDArray[Any], noted: dict[str, Repair], place: Place) -> NDArray[Any]:
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return values
    finite = np.isfinite(values)
    row = int(np.argwhere(~finite)[0, 0])
    note(
        noted, f"values of '{name}' not finite, made 0", place("vertex", row), int(np.count_nonzero(~finite))
    )
    return np.where(finite, values, values.dtype.type(0))


def _count(noted: dict[str, Repair], what: str, part: str, wrong: NDArray[np.bool_], place: Place) -> None:
    if wrong.any():
        note(noted, what, place(part, int(np.argmax(wrong))), int(np.count_nonzero(wrong)))


def _ids(values: NDArray[Any] | None) -> NDArray[np.int32] | None:
    return None if values is None else np.ascontiguousarray(values, np.int32)
