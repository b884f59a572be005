"""The last step of every reader: checks the content of a file, removes unusable parts, makes a `Mesh`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh, Substitute
from illumcli.geometry.mesh_checks import Place, faults, numbered
from illumcli.geometry.repairs import Repair, Repairs, note
from illumcli.records import Record

LARGEST = 1e18  # of a coordinate: products of two stay in the range of single precision
MOST_CORNERS = 2**31 - 1  # corners are counted in int32

Ints = NDArray[np.int64]
Indices: TypeAlias = NDArray[np.integer[Any]]


class RawMesh(Record):
    """A mesh as in its file, before any check; the fields are those of `Mesh`."""

    vertices: NDArray[np.float64]  # (V, 3)
    corners: Ints  # (C,) vertex of each corner, in range
    counts: Ints  # (P,) corners of each polygon
    normals: NDArray[np.float64] | None = None  # (K, 3)
    corner_normals: Indices | None = None  # (C,) row of each corner, -1 for none
    uvs: NDArray[np.float64] | None = None  # (U, 2)
    corner_uvs: Indices | None = None  # (C,)
    material_names: tuple[str, ...] = ()
    polygon_materials: Indices | None = None  # (P,)
    group_names: tuple[str, ...] = ()
    polygon_groups: Indices | None = None  # (P,)
    polygon_smoothing: Indices | None = None  # (P,)
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # (V,) or (V, k) each
    materials: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    substitutes: Mapping[str, Mapping[str, Substitute]] = field(default_factory=dict)
    occlusion: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    material_repairs: Repairs = field(default_factory=dict)
    repairs: Repairs = field(default_factory=dict)  # repairs of the reader


def checked_mesh(path: Path, raw: RawMesh, place: Place = numbered) -> Mesh:
    """The mesh without unusable parts; `InputError` if it has no faces or a used vertex is not finite.

    Polygons with fewer than three corners are dropped. Corners lose normals and uv that are not finite, and
    normals of length 0. Attributes and unused vertices that are not finite become 0. Everything is counted in
    the mesh's `repairs`.

    Parameters
    ----------
    place
        Function of the kind and number of an element: its place in the file, for messages.
    """
    # Drop degenerate polygons.
    noted = dict(raw.repairs)
    kept = raw.counts >= 3
    if not kept.all():
        _count(noted, "faces with fewer than three corners", "face", ~kept, place)
        raw = _with_polygons(raw, kept)
    if not len(raw.counts):
        raise InputError(f"{path}: has no faces; export the mesh with its faces")
    if len(raw.corners) > MOST_CORNERS:
        raise LimitError(
            f"{path}: has {len(raw.corners)} corners, the limit is {MOST_CORNERS}; use a smaller mesh"
        )

    # Detach unusable normals and uv from the corners.
    vertices = _finite_vertices(path, raw, noted, place)
    corner_normals, corner_uvs = raw.corner_normals, raw.corner_uvs
    if raw.normals is not None and corner_normals is not None:
        usable = _within(raw.normals) & raw.normals.any(axis=1)
        corner_normals = _unless(usable, corner_normals)
        _count(noted, "normals not finite or of no length", "normal", ~usable, place)
    if raw.uvs is not None and corner_uvs is not None:
        usable = _within(raw.uvs)
        corner_uvs = _unless(usable, corner_uvs)
        _count(noted, "uv not finite", "uv", ~usable, place)
    mesh = Mesh(
        vertices=vertices,
        corners=raw.corners.astype(np.int32),
        starts=starts_of(raw.counts).astype(np.int32),
        normals=raw.normals,
        corner_normals=_ids(corner_normals),
        uvs=raw.uvs,
        corner_uvs=_ids(corner_uvs),
        material_names=raw.material_names,
        polygon_materials=_ids(raw.polygon_materials),
        group_names=raw.group_names,
        polygon_groups=_ids(raw.polygon_groups),
        polygon_smoothing=_ids(raw.polygon_smoothing),
        attributes={name: _finite(name, values, noted, place) for name, values in raw.attributes.items()},
        materials=raw.materials,
        substitutes=raw.substitutes,
        occlusion=raw.occlusion,
        material_repairs=raw.material_repairs,
        repairs=noted,
    )
    face = np.flatnonzero(kept)
    return replace(
        mesh, repairs=faults(mesh, lambda part, n: place(part, int(face[n]) if part == "face" else n))
    )


def _with_polygons(raw: RawMesh, kept: NDArray[np.bool_]) -> RawMesh:
    """The mesh without the polygons that are not kept."""
    kept_corners = np.repeat(kept, raw.counts)
    return replace(
        raw,
        corners=raw.corners[kept_corners],
        counts=raw.counts[kept],
        corner_normals=_pick(raw.corner_normals, kept_corners),
        corner_uvs=_pick(raw.corner_uvs, kept_corners),
        polygon_materials=_pick(raw.polygon_materials, kept),
        polygon_groups=_pick(raw.polygon_groups, kept),
        polygon_smoothing=_pick(raw.polygon_smoothing, kept),
    )


def starts_of(counts: Indices) -> Ints:
    """(P + 1,) starts of consecutive runs of `counts` entries, and the end of the last."""
    return np.concatenate(([0], np.cumsum(counts, dtype=np.int64)))


def runs(starts: Indices, counts: Indices, step: int = 1) -> Ints:
    """start, start + step, ... with `counts` entries for each start, one run after the other."""
    within = np.arange(counts.sum(), dtype=np.int64) - np.repeat(starts_of(counts)[:-1], counts)
    return np.repeat(starts, counts) + step * within


def _finite_vertices(path: Path, raw: RawMesh, noted: dict[str, Repair], place: Place) -> NDArray[np.float64]:
    """The vertices; those that are NaN, infinite or beyond `LARGEST` become 0, or are refused if in use."""
    vertices = raw.vertices
    usable = _within(vertices)
    if usable.all():
        return vertices
    used = np.zeros(len(vertices), np.bool_)
    used[raw.corners] = True
    if (bad := np.flatnonzero(used & ~usable)).size:
        raise InputError(
            f"{path}: {len(bad)} of {len(vertices)} vertices are not finite or beyond {LARGEST:g}, the first "
            f"is number {bad[0] + 1}; repair the mesh where it was made"
        )
    _count(noted, "unused vertices that are not finite, made 0", "vertex", ~usable, place)
    return np.where(usable[:, None], vertices, 0.0)


def check_range(indices: Ints, size: int, refuse: Callable[[int], InputError]) -> None:
    """Refuse indices outside of 0..size - 1; `refuse` gives the error for the position of the first."""
    if len(indices) and (indices.min() < 0 or indices.max() >= size):
        raise refuse(int(np.argmax((indices < 0) | (indices >= size))))


def strip(indices: Indices) -> tuple[Ints, int]:
    """The triangles of strips, and the number of degenerate ones, which only join two strips.

    Parameters
    ----------
    indices : (S,) int
        Vertices; -1 ends a strip. Every second triangle is reversed, so that all have the same winding.

    Returns
    -------
    (T, 3) int64, int
    """
    ids = np.asarray(indices, np.int64)
    triples = np.stack([ids[:-2], ids[1:-1], ids[2:]], axis=1) if len(ids) > 2 else np.empty((0, 3), np.int64)

    # Reverse every second triangle, counted from the start of its strip.
    position = np.arange(len(ids))
    first = np.maximum.accumulate(np.where(ids == -1, position + 1, 0))[: len(triples)]
    reverse = (position[: len(triples)] - first) % 2 == 1
    triples[reverse, 0], triples[reverse, 1] = triples[reverse, 1], triples[reverse, 0]

    # Drop triples across the end of a strip, and triangles that repeat a vertex.
    triangles = triples[(triples != -1).all(axis=1)]
    a, b, c = triangles.T
    distinct = (a != b) & (b != c) & (c != a)
    return triangles[distinct], int(np.count_nonzero(~distinct))


def _within(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.all(np.abs(values) <= LARGEST, axis=1)
    return inside


def _pick(values: Indices | None, kept: NDArray[np.bool_]) -> Indices | None:
    return None if values is None else values[kept]


def _unless(usable: NDArray[np.bool_], corner_rows: Indices) -> Indices:
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


def _ids(values: Indices | None) -> NDArray[np.int32] | None:
    return None if values is None else np.ascontiguousarray(values, np.int32)
