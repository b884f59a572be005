"""Lines of a width, as polygons that share their edges and overlap nowhere."""

from __future__ import annotations

from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Points: TypeAlias = NDArray[np.float64]  # (N, 2)
Face: TypeAlias = list[int]

CURVE_STEPS = 8
"""Straight pieces of a parabola."""
ARC_STEP = np.pi / 12
"""Greatest angle between the corners of a round end [rad]."""
SHARP = 0.7
"""Lines that turn by more than this have a round outer corner, others a pointed one [rad]."""
DOT = 1.3
"""Radius of a dot, in half widths."""
GRID = 1e-3
"""Points are rounded to this, so that strokes meet in common nodes."""


def middle_lines(drawing: str) -> list[Points]:
    """The strokes of a drawing as polylines; `_letters` says how it is written."""
    return [_polyline(stroke.split()) for stroke in drawing.split("|")]


def _polyline(words: list[str]) -> Points:
    """(N, 2) points of one stroke, its parabolas cut into straight pieces."""
    points = [np.array([float(number) for number in word.lstrip("~").split(",")]) for word in words]
    is_control = [word.startswith("~") for word in words]
    line = [points[0]]
    for i in range(1, len(points)):
        if is_control[i]:
            following = points[i + 1]
            end = (points[i] + following) / 2 if is_control[i + 1] else following
            t = np.arange(1, CURVE_STEPS)[:, None] / CURVE_STEPS
            line += list((1 - t) ** 2 * line[-1] + 2 * t * (1 - t) * points[i] + t * t * end)
            if is_control[i + 1]:
                line.append(end)
        else:
            line.append(points[i])
    return np.array(line)


def thick_lines(lines: list[Points], radius: float) -> tuple[Points, list[Face]]:
    """Points and faces, counter-clockwise, of lines that are 2 `radius` wide, with round ends and corners.

    Lines that cross or touch are joined. Around each of their nodes there are corners between every two
    neighbouring lines; a line is the quad between the corners of its two nodes, a node the polygon of its
    own corners.
    """
    nodes, links = _network(lines)
    points: list[Points] = []
    faces: list[Face] = []
    first: dict[tuple[int, int], int] = {}  # the corner to the left of a line that leaves a node
    last: dict[tuple[int, int], int] = {}  # the one to its right
    for node, neighbours in enumerate(links):
        around: Face = []
        if not neighbours:
            ring = np.arange(0, 2 * np.pi, ARC_STEP)
            around = _append(points, nodes[node] + DOT * radius * _towards(ring))
        leaves = np.array([np.arctan2(*(nodes[each] - nodes[node])[::-1]) for each in neighbours])
        order = np.argsort(leaves)
        for at, following in zip(order, np.roll(order, -1), strict=True):
            gap = (leaves[following] - leaves[at]) % (2 * np.pi) or 2 * np.pi
            corners = _append(points, nodes[node] + radius * _corners(leaves[at], gap))
            first[node, neighbours[at]], last[node, neighbours[following]] = corners[0], corners[-1]
            around += corners
        if len(around) > 2:
            faces.append(around)
    for a, neighbours in enumerate(links):
        faces += [[last[a, b], first[b, a], last[b, a], first[a, b]] for b in neighbours if a < b]
    return np.array(points), faces


def _corners(angle: float, gap: float) -> Points:
    """(N, 2) corners, in radii, from the left side of a line that leaves at `angle` to the right side of the
    next one, `gap` further: where the sides meet, or an arc."""
    turn = gap - np.pi
    if turn < SHARP:
        return _towards(np.array([angle + gap / 2])) / np.sin(gap / 2)
    return _towards(angle + np.pi / 2 + np.linspace(0, turn, 1 + int(np.ceil(turn / ARC_STEP))))


def _towards(angle: NDArray[np.float64]) -> Points:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _append(points: list[Points], more: Points) -> Face:
    """The numbers of `more`, now at the end of `points`."""
    points += list(more)
    return list(range(len(points) - len(more), len(points)))


def _network(lines: list[Points]) -> tuple[Points, list[list[int]]]:
    """Nodes where lines end, bend, cross or touch, and the neighbours of each."""
    number: dict[tuple[float, ...], int] = {}

    def node(point: Points) -> int:
        return number.setdefault(tuple((point / GRID).round() * GRID), len(number))

    begin = np.concatenate([line[:-1] for line in lines])
    end = np.concatenate([line[1:] for line in lines])
    pairs = set()
    for a, b in zip(begin, end, strict=True):
        shares = np.unique(np.concatenate([[0, 1], _meetings(a, b, begin, end)]))
        passed = [node(point) for point in a + shares[:, None] * (b - a)]
        pairs |= {(i, j) for i, j in pairwise(passed) if i != j}
    for line in lines:
        node(line[0])
    links: list[set[int]] = [set() for _ in number]
    for i, j in pairs:
        links[i].add(j)
        links[j].add(i)
    return np.array(list(number)), [sorted(each) for each in links]


def _meetings(a: Points, b: Points, begin: Points, end: Points) -> NDArray[np.float64]:
    """Where on the way from a to b, 0 to 1, the lines from `begin` to `end` cross or touch it."""
    along, other, between = b - a, end - begin, begin - a
    area = along[0] * other[:, 1] - along[1] * other[:, 0]
    area = np.where(np.abs(area) < GRID, np.inf, area)
    share = (between[:, 0] * other[:, 1] - between[:, 1] * other[:, 0]) / area
    on_other = (between[:, 0] * along[1] - between[:, 1] * along[0]) / area
    within = (np.minimum(share, on_other) > -GRID) & (np.maximum(share, on_other) < 1 + GRID)
    return np.clip(share[within & np.isfinite(area)], 0, 1)
