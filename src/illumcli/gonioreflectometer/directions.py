"""Directions: turned about the normal, about another axis, by half and difference angles; grids of angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, dot, perpendicular, unit

LOWEST = np.radians(1.0)
"""Elevation of light and eye below which nothing is measured [rad]."""
LEAST_COSINE = float(np.sin(LOWEST))


def turned(d: Vectors, angle: Floats) -> Vectors:
    """(N, 3) directions turned about z."""
    cos, sin = np.cos(angle), np.sin(angle)
    out = np.empty_like(d)
    out[:, 0], out[:, 1], out[:, 2] = cos * d[:, 0] - sin * d[:, 1], sin * d[:, 0] + cos * d[:, 1], d[:, 2]
    return out


def about(axis: Vectors, local: Vectors) -> Vectors:
    """(N, 3) directions that are `local` to a frame with the unit vectors `axis` as z."""
    first, second = (np.stack(each) for each in perpendicular(axis))
    out: Vectors = (first * local[:, 0] + second * local[:, 1] + axis.T * local[:, 2]).T
    return out


def around_half_vector(h: Vectors, theta_d: Floats, phi_d: Floats) -> tuple[Vectors, Vectors]:
    """(N, 3) l and v by difference angles about unit half vectors: phi_d is 0 away from the normal z."""
    x, y, z = h.T
    sin_h = np.hypot(x, y)
    flat = sin_h < 1e-12
    along = (
        np.where(flat, 1.0, x / np.where(flat, 1.0, sin_h)),
        np.where(flat, 0.0, y / np.where(flat, 1.0, sin_h)),
    )
    out = []
    for sign in (1.0, -1.0):
        a = sign * np.sin(theta_d) * np.cos(phi_d)
        b = sign * np.sin(theta_d) * np.sin(phi_d)
        c = np.cos(theta_d)
        radial, up = a * z + c * sin_h, c * z - a * sin_h
        out.append(np.stack([radial * along[0] - b * along[1], radial * along[1] + b * along[0], up]).T)
    return out[0], out[1]


def half_angles(l: Vectors, v: Vectors) -> tuple[Floats, Floats, Floats]:
    """(N,) theta_h, theta_d and phi_d of pairs of directions: the inverse of `around_half_vector`."""
    h = unit(l + v)
    # X of the half vector's frame points away from the normal, Y = h x X across.
    x = h * h[:, 2:] - [0.0, 0.0, 1.0]
    y = np.stack([-h[:, 1], h[:, 0], np.zeros(len(h))], axis=1)
    phi_d = np.arctan2(dot(l, y), dot(l, x))
    return np.arccos(np.clip(h[:, 2], -1, 1)), np.arccos(np.clip(dot(l, h), -1, 1)), phi_d


class AngleGrid:
    """Directions by equal steps of the polar angle and the azimuth, at the centres of their cells."""

    def __init__(self, step: float) -> None:
        self.polar, self.around = round(90 / step), round(360 / step)
        theta = (np.arange(self.polar) + 0.5) * (np.pi / 2 / self.polar)
        phi = (np.arange(self.around) + 0.5) * (2 * np.pi / self.around)
        self.theta, self.phi = np.repeat(theta, self.around), np.tile(phi, self.polar)
        self.directions = np.stack(
            [
                np.sin(self.theta) * np.cos(self.phi),
                np.sin(self.theta) * np.sin(self.phi),
                np.cos(self.theta),
            ],
            axis=1,
        )
        squares = np.sin(np.arange(self.polar + 1) * (np.pi / 2 / self.polar)) ** 2
        self.projected = np.repeat(np.diff(squares) * (np.pi / self.around), self.around)
        """(C,) the integral of n.d over the solid angle of each cell."""

    def __len__(self) -> int:
        return self.polar * self.around

    def cells_of(self, d: Vectors) -> NDArray[np.int64]:
        """(N,) the cells that directions above the horizon lie in."""
        theta = np.arccos(np.clip(d[:, 2], 0, 1)) * (2 * self.polar / np.pi)
        phi = np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1.0 * self.around
        row, column = np.minimum(theta.astype(np.int64), self.polar - 1), phi.astype(np.int64) % self.around
        return row * self.around + column
