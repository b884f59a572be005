"""A surface given by formulas of two parameters; normals from the exact derivatives.

(x, y, z)(u, v),    normal = d/du x d/dv
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, field_validator

from illumcli.arrays import Vectors, length, unit
from illumcli.errors import InputError
from illumcli.formula import MAX_LENGTH, checked, parse
from illumcli.geometry.formula_normals import parametric_normal
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import CellsByCells, Shape
from illumcli.geometry.shapes._lattice import Lattice, around, turned, vertex_numbers, woven
from illumcli.schema.fields import Number, Pair

UV = ("u", "v")
WELD = 1e-9
"""Distance up to which nodes on a seam or at a pole are one vertex, in extents of the surface."""
MIN_NORMAL = 1e-12
"""Length below which a normal has no direction, in lengths of the longest one."""
POLE_OFFSET = 1e-7
"""Distance from a pole at which the limit of the normal is evaluated, in ranges of the parameter."""

FormulaText: TypeAlias = Annotated[
    str, Field(max_length=MAX_LENGTH), AfterValidator(partial(checked, variables=UV))
]
Range: TypeAlias = Pair[Number]


class Parametric(Shape):
    shape: Literal["parametric"] = "parametric"
    x: FormulaText
    """Formula of u and v: + - * / **, pi, e, sin cos tan sinh cosh tanh exp log sqrt abs atan2 min max."""
    y: FormulaText
    """Formula of u and v, as x."""
    z: FormulaText
    """Formula of u and v, as x."""
    u: Range = (0.0, 1.0)
    """First and last u."""
    v: Range = (0.0, 1.0)
    """First and last v."""
    resolution: CellsByCells = (64, 64)
    """Quads along u and v."""
    flip: bool = False
    """Outside is the other side, -(d/du x d/dv)."""

    @field_validator("u", "v")
    @classmethod
    def _grows(cls, span: tuple[float, float]) -> tuple[float, float]:
        if not span[0] < span[1]:
            raise ValueError(f"must run from low to high, is {list(span)}; `flip` turns the surface round")
        return span

    def triangles(self) -> int:
        return 2 * self.resolution[0] * self.resolution[1]

    def mesh(self) -> Mesh:
        """Quads; where the surface closes on itself or shrinks to a point, vertices are shared.

        Raises
        ------
        InputError
            A formula is not finite somewhere on the surface, or all of it is one line.
        """
        x, y, z = (parse(text, UV) for text in (self.x, self.y, self.z))
        # The nodes, and which of them are one vertex.
        columns, rows = self.resolution
        s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
        points = np.stack([f.value(self._u(s), self._v(t)) for f in (x, y, z)], axis=-1)
        self._refuse_holes(points, s, t)
        column_is_point, row_is_point, vertex = _welded(points)

        # Normals from the derivatives, at poles from beside them.
        at_s, at_t = _beside_poles(s, t, column_is_point, row_is_point)
        normals = parametric_normal(x, y, z, self._u(at_s).ravel(), self._v(at_t).ravel())
        uvs = np.stack([s + (at_s - s) * row_is_point[:, None], t + (at_t - t) * column_is_point], axis=-1)
        lattice = Lattice(points, _directions(normals).reshape(points.shape), uvs, vertex)
        mesh = woven(turned(lattice) if self.flip else lattice)
        if not mesh.polygon_count:
            raise InputError("parametric: the surface shrinks to a line or a point; check x, y and z")
        return mesh

    def _u(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """u at fractions of its range, exact at both ends."""
        return (1 - s) * self.u[0] + s * self.u[1]

    def _v(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        return (1 - t) * self.v[0] + t * self.v[1]

    def _refuse_holes(
        self, points: NDArray[np.float64], s: NDArray[np.float64], t: NDArray[np.float64]
    ) -> None:
        bad = ~np.isfinite(points).all(axis=-1)
        if bad.any():
            u, v = float(self._u(s[bad][0])), float(self._v(t[bad][0]))
            name = "xyz"[int(np.argmin(np.isfinite(points[bad][0])))]
            raise InputError(f"parametric: {name} is not finite at u = {u:g}, v = {v:g}; narrow the ranges")


def _welded(
    points: NDArray[np.float64],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.int64]]:
    """(C,) and (R,) which columns and rows are single points, and (R, C) vertex numbers with seams welded."""
    rows, columns = (count - 1 for count in points.shape[:2])
    reach = WELD * np.ptp(points.reshape(-1, 3), axis=0).max()

    def is_same(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(np.abs(a - b).max(axis=-1) <= reach)

    column_is_point = np.all(is_same(points, points[:1]), axis=0)
    row_is_point = np.all(is_same(points, points[:, :1]), axis=1)
    across = (
        around(columns)
        if columns > 2 and is_same(points[:, 0], points[:, -1]).all()
        else np.arange(columns + 1)
    )
    up = around(rows) if rows > 2 and is_same(points[0], points[-1]).all() else np.arange(rows + 1)
    return column_is_point, row_is_point, vertex_numbers(up, across, row_is_point, column_is_point)


def _beside_poles(
    s: NDArray[np.float64],
    t: NDArray[np.float64],
    column_is_point: NDArray[np.bool_],
    row_is_point: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parameters at which normals are evaluated.

    They are those of the nodes; at a border that is a point, just inside, in the middle of its triangle.

    The triangle keeps the node on its right at the bottom and on the left, the other one at the top and on
    the right (`woven`).
    """
    s, t = s.copy(), t.copy()
    rows, columns = (count - 1 for count in s.shape)
    for row, half, inwards in ((0, -0.5, POLE_OFFSET), (-1, 0.5, -POLE_OFFSET)):
        if row_is_point[row]:
            s[row] += half / columns
            t[row] += inwards
    for column, half, inwards in ((0, 0.5, POLE_OFFSET), (-1, -0.5, -POLE_OFFSET)):
        if column_is_point[column]:
            t[:, column] += half / rows
            s[:, column] += inwards
    return np.clip(s, 0, 1), np.clip(t, 0, 1)


def _directions(normals: Vectors) -> Vectors:
    """The normals made unit; zero where the derivatives vanish."""
    size = length(normals)
    finite = np.isfinite(size)
    is_valid = finite & (size > MIN_NORMAL * size.max(where=finite, initial=0.0))
    return unit(np.where(is_valid[:, None], normals, 0.0))
