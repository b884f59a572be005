"""The Utah teapot, from its 32 bicubic Bezier patches.

Every number is Newell's, in the usual proportions (the pot itself is higher by a factor 1.3). The patches lie
in four strips. Pot and lid are a quarter turned four times; handle and spout are a half and its mirror image.
The rims of pot and lid are open, and so are the ends of handle and spout, which run into the pot.

References
----------
Newell, M. (1975). The utilization of procedure models in digital image synthesis. PhD thesis, Univ. of Utah.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from illumcli.arrays import cross, unit
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Shape
from illumcli.geometry.shapes._lattice import Lattice, around, vertex_numbers, woven
from illumcli.schema.fields import Positive

# control points (radius, height); the outside is on the right
POT = (
    *((0, 0), (1.425, 0), (1.5, 0.075), (1.5, 0.15)),  # bottom
    *((1.5, 0.225), (2, 0.45), (2, 0.9), (2, 1.35), (1.75, 1.875), (1.5, 2.4)),  # body
    *((1.4375, 2.53125), (1.3375, 2.53125), (1.4, 2.4)),  # rim
)
LID = (
    *((1.3, 2.4), (1.3, 2.55), (0.4, 2.55), (0.2, 2.7)),
    *((0, 2.85), (0.8, 3.15), (0, 3.15)),  # knob
)
QUARTER = 0.56  # a quarter circle: (1, 0), (1, 0.56), (0.56, 1), (0, 1) times the radius
KNOB = {0.8: 0.5625}  # the one ring that is a little wider, 0.45 for 0.448

# control points (x, height) of the inner and of the outer seam, and half the width between
HANDLE = (
    ((-1.6, 2.025), (-2.3, 2.025), (-2.7, 2.025), (-2.7, 1.8), (-2.7, 1.575), (-2.5, 1.125), (-2, 0.9)),
    ((-1.5, 2.25), (-2.5, 2.25), (-3, 2.25), (-3, 1.8), (-3, 1.35), (-2.65, 0.9375), (-1.9, 0.6)),
    (0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3),
)
SPOUT = (
    ((1.7, 1.425), (2.6, 1.425), (2.3, 2.1), (2.7, 2.4), (2.8, 2.475), (2.9, 2.475), (2.8, 2.4)),
    ((1.7, 0.6), (3.1, 0.825), (2.4, 2.025), (3.3, 2.4), (3.525, 2.49375), (3.45, 2.5125), (3.2, 2.4)),
    (0.66, 0.66, 0.25, 0.25, 0.25, 0.15, 0.15),
)

LEFT, RIGHT, HEIGHT = -3.0, 3.4340751254711073, 3.15  # handle, lip of the spout, knob


class Teapot(Shape):
    shape: Literal["teapot"] = "teapot"
    size: Positive = 2.0
    """Extent from handle to spout, along x; the height is 0.49 of it."""
    resolution: Annotated[int, Field(ge=2, le=512)] = 12
    """Quads along each side of a patch."""

    def triangles(self) -> int:
        return 2 * 36 * self.resolution**2

    def mesh(self) -> Mesh:
        """Quads, triangles at the knob and in the middle of the bottom; u runs around, v up or along."""
        scale = self.size / (RIGHT - LEFT)
        middle = np.array([(LEFT + RIGHT) / 2, HEIGHT / 2, 0.0])
        strips = (
            _turned_quarters(POT),
            _turned_quarters(LID),
            _mirrored_half(*HANDLE),
            _mirrored_half(*SPOUT),
        )
        return woven(*(_strip((net - middle) * scale, self.resolution) for net in strips))


def _turned_quarters(profile: ArrayLike) -> NDArray[np.float64]:
    """(3 m + 1, 13, 3) control points of a profile turned once about the y axis, from x towards -z."""
    radius, height = np.array(profile, np.float64).T
    k = np.array([KNOB.get(r, QUARTER) for r in radius.tolist()])
    one = np.ones_like(k)
    quarter = np.stack([one + 0j, one + 1j * k, k + 1j * one], axis=1)
    turned = (
        np.concatenate([quarter, 1j * quarter, -quarter, -1j * quarter, one[:, None]], axis=1)
        * radius[:, None]
    )
    return np.stack([turned.real, np.broadcast_to(height[:, None], turned.shape), -turned.imag], axis=-1)


def _mirrored_half(inner: ArrayLike, outer: ArrayLike, width: ArrayLike) -> NDArray[np.float64]:
    """(7, 7, 3) control points around a tube: inner seam, front, outer seam, back, inner seam."""
    near, far, half = np.array(inner), np.array(outer), np.array(width, np.float64)
    seams = np.stack([near, near, far, far, far, near, near], axis=1)
    depth = half[:, None] * np.array([0, 1, 1, 0, -1, -1, 0])
    return np.concatenate([seams, depth[..., None]], axis=-1)


def _strip(net: NDArray[np.float64], resolution: int) -> Lattice:
    """The patches of a net that closes around its columns, `resolution` quads along each of their sides."""
    # Positions and both derivatives at the nodes.
    along, rising = _bernstein(len(net), resolution)
    across, turning = _bernstein(net.shape[1], resolution)

    def bezier(up: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.einsum("ra,abx,cb->rcx", up, net, right, optimize=True)

    points, right, up = bezier(along, across), bezier(along, turning), bezier(rising, across)

    # Normals.
    row_is_point = np.zeros(len(points), bool)
    row_is_point[[0, -1]] = (net == net[:, :1]).all(axis=(1, 2))[[0, -1]]
    # where a row shrinks to a point, d/du is 0 and its limit is along d2/du dv, backwards at the last row
    right[row_is_point] = bezier(rising, turning)[row_is_point]
    right[-1] *= -1 if row_is_point[-1] else 1
    normals = unit(cross(right.reshape(-1, 3), up.reshape(-1, 3))).reshape(points.shape)

    # uv, at poles of the middles between columns.
    v, u = np.meshgrid(np.linspace(0, 1, len(along)), np.linspace(0, 1, len(across)), indexing="ij")
    u[0] -= row_is_point[0] * 0.5 / (len(across) - 1)
    u[-1] += row_is_point[-1] * 0.5 / (len(across) - 1)
    vertex = vertex_numbers(np.arange(len(along)), around(len(across) - 1), row_is_point)
    return Lattice(points, normals, np.stack([u, v], axis=-1), vertex)


def _bernstein(count: int, resolution: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, count) weights of the control points of joined cubics at each node, and of the derivative there."""
    node = np.arange((count - 1) // 3 * resolution + 1)
    patch = np.minimum(node // resolution, (count - 1) // 3 - 1)
    t = node / resolution - patch
    s = 1 - t
    value, slope = np.zeros((len(node), count)), np.zeros((len(node), count))
    for k, weight, derivative in (
        (0, s**3, -3 * s**2),
        (1, 3 * s**2 * t, 3 * s**2 - 6 * s * t),
        (2, 3 * s * t**2, 6 * s * t - 3 * t**2),
        (3, t**3, 3 * t**2),
    ):
        value[node, 3 * patch + k] = weight
        slope[node, 3 * patch + k] = derivative
    return value, slope
