"""Cells of a few points of one object that lie together and whose normals agree, and cells near each.

Points along a compact order are cut into groups of a size, and a group whose normals disagree (both sides of
a thin sheet, a hard edge) into cells of its own. Cells replace points where neighbours are searched: there
are eight times fewer of them, or more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors
from illumcli.baking.compiled_cells import CellSearch, cell_loop
from illumcli.records import Record

SIZE = 8
"""Points of a cell, at most: those of the smallest boxes of a compact order; a power of 2."""
SAME_CELL = 0.7
"""Least cosine between the normals of a cell's points and its first point's."""
AGREE = 0.5
"""Least cosine between the mean normals of cells that are near each other."""
GROUP, GROUPS_NEAR = 16, 16
"""Boxes of one group, and groups near each in which its nearest boxes are searched."""
BRUTE = 1 << 10
"""Boxes that are compared each with each."""
ROWS = 32
"""Groups at a time: their distances stay in a core's own cache."""
TOUCHING = 2.5e-4
"""Weight of the squared distance of the centres of two boxes [per (2 radii)^2], beside that of their gap."""
PLACE_BITS = np.uint64(16)
PLACES = np.uint64((1 << 16) - 1)
"""Bits of a key of a distance that hold a place."""
FAR_KEY = np.uint64(int(np.array(np.inf, F).view(np.uint32)) << 16)
"""Keys from here on are those of infinite distances."""
APART = 8.0
"""Distance between objects along a fourth axis [radii]: more than any within an object."""


class Cells(Record):
    """C cells over M points."""

    points: NDArray[np.int64]  # (C, size) points of each cell; its first again where it has fewer
    filled: NDArray[np.bool_]  # (C, size) False where it has fewer
    near: NDArray[np.int64]  # (C, K) nearest cells that agree, itself first; C where there are fewer


def cells_of(
    position: Vectors, n: Vectors, objects: Ids, order: NDArray[np.int64], near: int, size: int = SIZE
) -> Cells:
    """Cells of up to `size` points at (M, 3) positions with (M, 3) unit normals, which follow each other in a
    compact order, and the `near` nearest cells of each."""
    # groups along the order, one object after the other
    order = order[np.argsort(objects[order], kind="stable")]
    group = np.arange(len(order)) // size
    normal, owner = n[order].astype(np.float64), objects[order]

    # cells are called after their first point: the first of each group, then of what disagrees with it
    first = np.empty(len(order), np.int64)
    rest = np.arange(len(order))
    while rest.size:
        begins = np.flatnonzero(np.diff(group[rest], prepend=-1))
        seed = np.repeat(rest[begins], np.diff(np.append(begins, len(rest))))
        agrees = (_dot(normal[rest], normal[seed]) >= SAME_CELL) & (owner[rest] == owner[seed])
        joins = agrees | (rest == seed)
        first[rest[joins]] = seed[joins]
        rest = rest[~joins]

    # their points
    by_cell = np.argsort(first, kind="stable")
    begins = np.flatnonzero(np.diff(first[by_cell], prepend=-1))
    count = np.diff(np.append(begins, len(order)))
    slot = np.arange(size)
    filled = slot < count[:, None]
    points = order[by_cell[np.where(filled, begins[:, None] + slot, begins[:, None])]]

    # the nearest, by the centres of cells
    share = filled / count[:, None]
    centre = np.stack([(share * axis[points]).sum(axis=1) for axis in position.T.astype(np.float64)], axis=1)
    mean = np.stack([(share * axis[points]).sum(axis=1) for axis in n.T.astype(np.float64)], axis=1)
    mean /= np.maximum(np.sqrt(_dot(mean, mean)), 1e-30)[:, None]
    placed = np.concatenate([centre, APART * objects[points[:, :1]]], axis=1)
    return Cells(points, filled, nearest(placed, mean, near))


def nearest(centre: NDArray[np.float64], normal: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """(C, count) the cells whose centres are nearest to that of each among those whose normals agree with it,
    the cell itself first; C where there are fewer.

    Cells are searched in the groups whose boxes are nearest to that of their own group; `centre` is (C, 4) in
    the order of the cells.
    """
    cells = len(centre)
    if not cells:
        return np.zeros((0, count), np.int64)
    member = _members(np.arange(-(-cells // GROUP)), cells)
    groups = nearest_boxes(centre[member].min(axis=1), centre[member].max(axis=1), GROUPS_NEAR)
    axes, normals = (np.ascontiguousarray(each.T, F) for each in (centre, normal))
    search = CellSearch(axes, normals, groups, GROUP, AGREE, (APART / 2) ** 2)
    out = np.full((len(member) * GROUP, count), cells)
    loop = cell_loop()
    if loop is None:
        _search(search, member, out)
    else:
        loop.nearest(search, 0, len(groups), out)
    return out[:cells]


def _search(of: CellSearch, member: NDArray[np.int64], out: NDArray[np.int64]) -> None:
    """The nearest cells of each, in the rows of `out`."""
    cells, count = of.centre.shape[1], out.shape[1]
    for begin in range(0, len(member), ROWS):
        own = member[begin : begin + ROWS]
        near = of.groups[begin : begin + ROWS]
        other = np.where(near[:, :, None] < 0, -1, near[:, :, None] * GROUP + np.arange(GROUP))
        other = other.reshape(len(own), -1)
        is_cell = (other >= 0) & (other < cells)
        other = np.where(is_cell, other, 0)

        # squared distances, infinite to cells of other objects and to those that disagree
        square = np.zeros((*own.shape, other.shape[1]), F)
        cosine = np.zeros_like(square)
        for axis in of.centre:
            square += np.square(axis[own][:, :, None] - axis[other][:, None])
        for axis in of.normal:
            cosine += axis[own][:, :, None] * axis[other][:, None]
        square[(cosine < of.agree) | (square > of.apart) | ~is_cell[:, None]] = np.inf

        # The least, and of equal ones the first: the bits of positive floats order like the numbers.
        place = np.arange(other.shape[1], dtype=np.uint64)
        keys = square.view(np.uint32).astype(np.uint64) + np.uint64(1) << PLACE_BITS | place
        itself = own[:, :, None] == np.where(is_cell, other, -1)[:, None]
        keys &= np.where(itself, PLACES, ~np.uint64(0))
        keys = keys.reshape(-1, keys.shape[2])
        keys = np.sort(np.partition(keys, count - 1, axis=1)[:, :count] if count < keys.shape[1] else keys)
        chosen = np.take_along_axis(np.repeat(other, GROUP, axis=0), (keys & PLACES).astype(np.int64), axis=1)
        rows = slice(begin * GROUP, begin * GROUP + len(chosen))
        out[rows, : chosen.shape[1]] = np.where(keys < FAR_KEY, chosen, cells)


def nearest_boxes(low: NDArray[np.float64], high: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """(B, count) the nearest boxes of each, itself among them; -1 where there are fewer.

    Many boxes are searched in the groups of consecutive ones whose boxes are nearest; those are chosen in the
    same way.
    """
    boxes = len(low)
    if boxes <= BRUTE:
        candidates = np.arange(boxes)[None]
    else:
        member = _members(np.arange(-(-boxes // GROUP)), boxes)
        groups = nearest_boxes(low[member].min(axis=1), high[member].max(axis=1), 2 * GROUPS_NEAR)
        others = np.where(groups[:, :, None] < 0, -1, groups[:, :, None] * GROUP + np.arange(GROUP))
        candidates = np.repeat(others.reshape(len(member), -1), GROUP, axis=0)[:boxes]
        candidates = np.where(candidates < boxes, candidates, -1)
    out = np.full((boxes, count), -1)
    for begin in range(0, boxes, ROWS):
        rows = slice(begin, begin + ROWS)
        other = candidates if len(candidates) == 1 else candidates[rows]
        square = np.zeros((len(low[rows]), other.shape[1]))
        for least, most in zip(low.T, high.T, strict=True):
            at, end = least[other], most[other]
            gap = np.maximum(at - most[rows, None], least[rows, None] - end)
            square += np.square(np.maximum(gap, 0))
            # of boxes that touch, those whose centres are nearer first
            square += TOUCHING * np.square((at + end) - (least + most)[rows, None])
        square[np.broadcast_to(other < 0, square.shape)] = np.inf
        square[other == np.arange(begin, begin + len(square))[:, None]] = -1
        place, distance = _least(square, count)
        chosen = np.take_along_axis(np.broadcast_to(other, square.shape), place, axis=1)
        out[rows, : chosen.shape[1]] = np.where(np.isfinite(distance), chosen, -1)
    return out


def _members(group: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(G, 16) numbers of each group, of `count` in all; the last again where there are no more."""
    return np.minimum(group[:, None] * GROUP + np.arange(GROUP), count - 1)


def _least(square: NDArray[np.float64], count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Places of the least values of each row, ascending, and the values."""
    count = min(count, square.shape[1])
    place = np.argpartition(square, count - 1, axis=1)[:, :count]
    values = np.take_along_axis(square, place, axis=1)
    ascending = np.lexsort((place, values), axis=1)
    return np.take_along_axis(place, ascending, axis=1), np.take_along_axis(values, ascending, axis=1)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> Floats:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
