"""A surface f(x, y, z) = 0 inside a box; normals from the exact gradient, outside where f is above 0.

Polygonised as a surface net: every cubic cell that the surface crosses holds one vertex, every crossed edge
between four cells makes a quad. Vertices start at the mean of the crossings around them and are moved onto
the surface along the gradient. A closed surface gives a closed mesh; where two sheets pass one cell an edge
may join four quads. Where the box cuts the surface, the mesh ends within two cells of the box. At a crease of
f a vertex has the normal of one side; normals computed from the polygons with a crease angle suit it better.

References
----------
Gibson, S. F. F. (1998). Constrained elastic surface nets. MICCAI '98. Here projected instead of relaxed.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from illumcli.arrays import Vectors, dot, length, unit
from illumcli.errors import InputError, LimitError
from illumcli.formula import MAX_LENGTH, Formula, checked, parse
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import MAX_TRIANGLES, TRIANGLE_BYTES, Shape
from illumcli.memory import refuse_beyond
from illumcli.schema.fields import Vector

XYZ = ("x", "y", "z")
NODES_AT_ONCE = 2**20
"""Grid nodes that are evaluated together."""
CONVERGED = 1e-13
"""Length of the last Newton step, in edges of a cell."""
NODE_OFFSET = 0.1180339887
"""Offset of inner nodes from round numbers, in edges of a cell; not a simple fraction."""
MAX_NEWTON_STEPS = 12
"""Convergence is quadratic: four steps are usual, creases of f take more."""

FormulaText: TypeAlias = Annotated[
    str, Field(max_length=MAX_LENGTH), AfterValidator(partial(checked, variables=XYZ))
]


class Implicit(Shape):
    shape: Literal["implicit"] = "implicit"
    f: FormulaText
    """Formula of x, y and z: + - * / **, pi, e, sin cos tan sinh cosh tanh exp log sqrt abs atan2 min max."""
    low: Vector = (-1.0, -1.0, -1.0)
    """Lowest corner of the box that is searched."""
    high: Vector = (1.0, 1.0, 1.0)
    """Highest corner of that box."""
    resolution: Annotated[int, Field(ge=2, le=512)] = 64
    """Cubic cells along the longest edge of the box; parts thinner than a cell may be missed."""

    @field_validator("high")
    @classmethod
    def _above_low(cls, high: tuple[float, float, float], info: ValidationInfo) -> tuple[float, float, float]:
        low = info.data.get("low")
        if low is not None and not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"must be above low, {list(low)}, along every axis, is {list(high)}")
        return high

    def triangles(self) -> int:
        """An estimate for surfaces that cross the box several times; `mesh` refuses those with too many."""
        return min(24 * self.resolution**2, MAX_TRIANGLES)

    def mesh(self) -> Mesh:
        """Quads; without uv.

        Raises
        ------
        InputError
            f does not change its sign in the box.
        LimitError
            The surface would have more than 2e7 triangles.
        """
        # The quads of the surface net.
        f = parse(self.f, XYZ)
        low, high = np.array(self.low), np.array(self.high)
        edge = (high - low).max() / self.resolution
        counts = np.maximum(np.rint((high - low) / edge), 2).astype(int)
        axes = [_nodes(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
        crossings, cells = _net(f, axes)
        if not len(cells):
            raise InputError(
                f"implicit: {self.f} does not change its sign in the box from {list(self.low)} to"
                f" {list(self.high)}; move the box or raise `resolution`"
            )

        # A vertex per cell, moved onto the surface.
        corners = np.unique(cells, return_inverse=True)[1].ravel().astype(np.int32)
        sums = [np.bincount(corners, np.repeat(crossing, 4)) for crossing in crossings.T]
        points = _onto_surface(f, np.stack(sums, axis=1) / np.bincount(corners)[:, None], edge)
        normals = np.asarray(unit(_value_and_gradient(f, points)[1]), np.float64)
        has_normal = np.any(normals, axis=1)
        return Mesh(
            vertices=points,
            corners=corners,
            starts=np.arange(0, len(corners) + 1, 4, dtype=np.int32),
            normals=normals,
            corner_normals=np.where(has_normal[corners], corners, -1).astype(np.int32),
        )


def _nodes(low: float, high: float, count: int) -> NDArray[np.float64]:
    """(count + 1,) coordinates of the grid's nodes, the inner ones a little off round numbers.

    Planes of symmetry and the like are at round numbers, and quads of a surface that meets nodes exactly are
    pinched.
    """
    nodes = np.linspace(low, high, count + 1)
    nodes[1:-1] += NODE_OFFSET * (high - low) / count
    return nodes


def _net(f: Formula, axes: list[NDArray[np.float64]]) -> tuple[Vectors, NDArray[np.int64]]:
    """(Q, 3) where the surface crosses each inner edge of the grid, and (Q, 4) the cells around that edge.

    The cells run counter-clockwise seen from where f is above 0.
    """
    # Inner edges along each axis whose ends are on different sides of the surface.
    inside = _inside(f, axes)
    shape = [len(axis) - 1 for axis in axes]
    crossed: list[tuple[tuple[NDArray[Any], ...], tuple[int, int, int]]] = []
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        inner = inside.transpose(a, b, c)[:, 1:-1, 1:-1]
        crossed.append((np.nonzero(np.not_equal(inner[1:], inner[:-1])), (a, b, c)))
    count = 2 * sum(len(where[0]) for where, _ in crossed)
    if count > MAX_TRIANGLES:
        raise LimitError(f"implicit: {count} triangles, at most {MAX_TRIANGLES} are made; lower `resolution`")
    refuse_beyond(TRIANGLE_BYTES * count, f"implicit: {count} triangles", "lower `resolution`")

    # The crossing point on each of them, and the four cells around it.
    crossings, cells = [], []
    for (i, j, k), (a, b, c) in crossed:
        grows = inside.transpose(a, b, c)[i, j + 1, k + 1, None]
        near = np.empty((len(i), 3))
        near[:, a], near[:, b], near[:, c] = axes[a][i], axes[b][j + 1], axes[c][k + 1]
        far = near.copy()
        far[:, a] = axes[a][i + 1]
        crossings.append(near + _crossing(f.value(*near.T), f.value(*far.T))[:, None] * (far - near))
        around = np.empty((3, len(i), 4), np.int64)
        around[a] = i[:, None]
        around[b] = j[:, None] + np.array([0, 1, 1, 0])
        around[c] = k[:, None] + np.array([0, 0, 1, 1])
        cell = np.asarray(np.ravel_multi_index(tuple(around), shape))
        cells.append(np.where(grows, cell, cell[:, ::-1]))
    return np.concatenate(crossings), np.concatenate(cells)


def _inside(f: Formula, axes: list[NDArray[np.float64]]) -> NDArray[np.bool_]:
    """True at nodes of the grid where f is below 0; evaluated a few layers at a time, to save memory."""
    x, y, z = axes
    inside = np.empty((len(x), len(y), len(z)), bool)
    layers = max(1, NODES_AT_ONCE // (len(y) * len(z)))
    for first in range(0, len(x), layers):
        part = slice(first, first + layers)
        inside[part] = f.value(x[part, None, None], y[:, None], z) < 0
    return inside


def _crossing(near: NDArray[np.float64], far: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root of the linear interpolation between both values, from 0 to 1; 0.5 where they are not finite."""
    with np.errstate(all="ignore"):
        share = near / (near - far)
    return np.clip(np.where(np.isfinite(share), share, 0.5), 0, 1)


def _onto_surface(f: Formula, start: NDArray[np.float64], edge: float) -> NDArray[np.float64]:
    """(N, 3) the points moved to f = 0 by Newton steps along the gradient.

    A point keeps its place if the steps lead farther than a cell, or not closer to 0, as where f jumps.
    """
    points = start.copy()
    active = np.arange(len(points))
    for _ in range(MAX_NEWTON_STEPS):
        value, gradient = _value_and_gradient(f, points[active])
        steepness = dot(gradient, gradient)
        with np.errstate(all="ignore"):
            step = gradient * (value / steepness)[:, None]
        step[~np.all(np.isfinite(step), axis=1)] = 0
        size = length(step)
        step *= np.minimum(1, edge / 2 / np.maximum(size, edge / 2))[:, None]
        points[active] -= step
        active = active[size > CONVERGED * edge]
    kept = (length(points - start) <= edge) & (np.abs(f.value(*points.T)) <= np.abs(f.value(*start.T)))
    return np.where(kept[:, None], points, start)


def _value_and_gradient(f: Formula, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], Vectors]:
    """(N,) f, and (N, 3) its gradient; zero where that is not finite."""
    value, slopes = f.gradient(*points.T)
    gradient = np.stack(slopes, axis=1)
    return value, np.where(np.isfinite(gradient).all(axis=1, keepdims=True), gradient, 0.0)
