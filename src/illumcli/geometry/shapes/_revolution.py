"""Surfaces of revolution about the y axis, from a profile with its normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._lattice import Lattice, around, vertex_numbers, woven
from illumcli.records import Record


class Profile(Record):
    """A curve in a half plane that ends at the axis; the outside is on its right."""

    radius: NDArray[np.float64]  # (M,) 0 where the curve meets the axis, exactly
    height: NDArray[np.float64]  # (M,)
    normal: NDArray[np.float64]  # (M, 2) unit, away from the axis and upwards
    flat: bool = False  # a cap: uv are the disc in the unit square, otherwise around and along


def profile(radius: ArrayLike, height: ArrayLike, normal: ArrayLike, flat: bool = False) -> Profile:
    """A profile; a single number is used for all points."""
    r, y = np.broadcast_arrays(np.asarray(radius, np.float64), np.asarray(height, np.float64))
    return Profile(r, y, np.broadcast_to(np.asarray(normal, np.float64), (len(r), 2)), flat)


def lathed(profiles: list[Profile], segments: int, closed: bool = False) -> Mesh:
    """The mesh of profiles that follow one another, turned about the axis.

    u runs once around from +x towards -z, v along the profile. Profiles that meet share their vertices and
    keep their own normals. On the axis each triangle has the normal and the u of its middle.

    Parameters
    ----------
    closed : bool
        The last point is the first one again.
    """
    # One curve of all profiles; points where it does not move are one row of vertices.
    radius = np.concatenate([each.radius for each in profiles])
    height = np.concatenate([each.height for each in profiles])
    normal = np.concatenate([each.normal for each in profiles])
    along = np.concatenate([np.linspace(0, 1, len(each.radius)) for each in profiles])
    flat = np.concatenate([np.full(len(each.radius), each.flat) for each in profiles])
    moves = (np.diff(radius) != 0) | (np.diff(height) != 0)
    row = np.concatenate([[0], np.cumsum(moves)])
    if closed:
        row[-1] = 0

    # Turns of the columns, at poles those of the middles between them.
    pole = radius == 0
    turn = np.arange(segments + 1) + np.zeros((len(radius), 1))
    turn[pole] += np.where(np.arange(len(radius)) == 0, -0.5, 0.5)[pole, None]
    # the sine and cosine of the first and the last column are the same doubles
    angle = 2 * np.pi * np.where(turn == segments, 0, turn) / segments
    cosine, sine = np.cos(angle), np.sin(angle)

    # Positions, normals, and uv around and along or, on caps, of the disc.
    points = np.stack(
        np.broadcast_arrays(radius[:, None] * cosine, height[:, None], -radius[:, None] * sine), -1
    )
    normals = np.stack(np.broadcast_arrays(normal[:, :1] * cosine, normal[:, 1:], -normal[:, :1] * sine), -1)
    side = np.where(normal[:, 1:] < 0, -1.0, 1.0)
    rim = radius.max()
    disc = 0.5 + 0.5 / rim * np.stack([points[..., 0], -points[..., 2] * side], axis=-1)
    wrapped = np.stack(np.broadcast_arrays(turn / segments, along[:, None]), axis=-1)
    uvs = np.where(flat[:, None, None], disc, wrapped)
    return woven(Lattice(points, normals, uvs, vertex_numbers(row, around(segments), pole)))
