"""The data of BRDF views, in double precision: slices, lobes, a lit sphere, a lit plane.

The surface is z = 0 with its normal along z and its grain along x, or at an angle to it; light comes from the
left, in the plane of x and z. A value is f_r = response / n.l, or with `times_cos` the response itself: the
radiance that leaves under a light of unit irradiance across its own direction. For the intensity models of
the texts f_r is the BRDF that gives the same image; it grows without bound as the light approaches the
horizon.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, column_major, cross, dot, unit
from illumcli.models._base import IlluminationModel
from illumcli.records import Record
from illumcli.shading.terms import evaluate, given_terms

Doubles = NDArray[np.float64]

SUN = (-0.55, 0.6, 0.58)
"""Direction from the sphere to its light; the eye looks along -z."""
LAMP = (0.0, 3.0, 0.8)
"""Position of the light above the plane, on the far side: the eye looks towards it."""
EYE = (0.0, -4.0, 1.5)


class Counted(Record):
    """A model that counts what is drawn of it as 0 because it is negative or not finite."""

    model: IlluminationModel
    mended: Counter[str]
    """The number of such values of each lobe."""


Look: TypeAlias = IlluminationModel | Counted
"""What is drawn."""


def values(model: Look, n: Vectors, l: Vectors, v: Vectors, t: Vectors, times_cos: bool = True) -> Doubles:
    """(N, 3) the response, or f_r, of N directions; 0 where light or eye is at or below the horizon."""
    out = np.zeros(l.shape, order="F")
    n_l = dot(n, l)
    lit = np.flatnonzero((n_l > 0) & (dot(n, v) > 0))
    model, mended = (model.model, model.mended) if isinstance(model, Counted) else (model, None)
    lobes = model.lobes()
    if not (lit.size and lobes):
        return out
    vectors = {"n": n, "l": l, "v": v, "t": t}
    given: dict[str, Any] = {
        word: column_major(vectors[word][lit]) for word in given_terms(lobes) & vectors.keys()
    }
    if "light" in given_terms(lobes):
        given["light"] = np.ones(3)
    out[lit] = sum(evaluate(lobes, given, mended).values())
    if not times_cos:
        out[lit] /= n_l[lit][:, None]
    return out


def seen_from(model: Look, incidence: float, v: Vectors, times_cos: bool, grain: float = 0.0) -> Doubles:
    """(N, 3) values of the flat surface lit from `incidence` degrees, seen from unit vectors `v`, with its
    grain at `grain` degrees from x towards y."""

    def everywhere(vector: tuple[float, float, float]) -> Vectors:
        return np.broadcast_to(np.array(vector), v.shape)

    angle, turn = np.radians([incidence, grain])
    l = everywhere((-np.sin(angle), 0.0, np.cos(angle)))
    t = everywhere((np.cos(turn), np.sin(turn), 0.0))
    return values(model, everywhere((0.0, 0.0, 1.0)), l, v, t, times_cos)


def slice_angles(incidence: float) -> Doubles:
    """Angles of view of a slice, degrees from -90 on the light's side to 90, without the horizon itself.

    Their distance is a quarter of a degree, less near the mirror direction, where a highlight may be
    narrower.
    """
    near = np.geomspace(1e-3, 2, 40)
    angles = np.concatenate([np.linspace(-90, 90, 721), incidence + near, incidence - near, [incidence]])
    return np.unique(angles[np.abs(angles) < 90])


def polar_slice(
    model: Look, incidence: float, times_cos: bool = False, grain: float = 0.0
) -> tuple[Doubles, Doubles]:
    """(K,) angles of view in degrees and (K, 3) values in the plane of incidence.

    Parameters
    ----------
    incidence : float
        Angle of the light to the normal [degrees]; its mirror direction is seen at the same angle of view.
    grain : float
        Angle of the grain to the plane of incidence [degrees].
    """
    angles = slice_angles(incidence)
    theta = np.radians(angles)
    v = column_major(np.stack([np.sin(theta), np.zeros_like(theta), np.cos(theta)], axis=1))
    return angles, seen_from(model, incidence, v, times_cos, grain)


def across_slice(model: Look, incidence: float, times_cos: bool = False) -> tuple[Doubles, Doubles]:
    """(K,) angles from the mirror direction in degrees and (K, 3) values, at right angles to the plane of
    incidence.

    Parameters
    ----------
    incidence : float
        Angle of the light to the normal [degrees].
    """
    angles = slice_angles(0)
    away, angle = np.radians(angles), np.radians(incidence)
    mirrored = np.cos(away)
    v = np.stack([mirrored * np.sin(angle), np.sin(away), mirrored * np.cos(angle)], axis=1)
    return angles, seen_from(model, incidence, column_major(v), times_cos)


def lobe(
    model: Look, incidence: float, times_cos: bool = False, steps: int = 90, grain: float = 0.0
) -> tuple[Doubles, Doubles]:
    """(S + 1, 2 S + 1, 3) unit directions over the hemisphere, and (S + 1, 2 S + 1, 3) values there.

    The columns run from the mirror direction to the horizon, crowded at their beginning: a narrow highlight
    is drawn as well as a wide one.
    """
    # Polar coordinates about the mirror direction; `away` ends at the horizon.
    angle = np.radians(incidence)
    around = np.linspace(0, 2 * np.pi, 2 * steps + 1)
    horizon = np.arctan2(np.cos(angle), np.cos(around) * np.sin(angle)) - 1e-6
    away = np.linspace(0, 1, steps + 1)[:, None] ** 2 * horizon

    # Rotate the axis from the mirror direction to the normal.
    x, y, z = np.sin(away) * np.cos(around), np.sin(away) * np.sin(around), np.cos(away)
    v = np.stack([x * np.cos(angle) + z * np.sin(angle), y, z * np.cos(angle) - x * np.sin(angle)], axis=-1)
    values = seen_from(model, incidence, unit(column_major(v.reshape(-1, 3))), times_cos, grain)
    return v, np.reshape(values, v.shape)


def irradiance(model: Look) -> float:
    """Irradiance of the light in pictures: pi for a BRDF, so that white Lambert is white, 1 for the intensity
    models."""
    model = model.model if isinstance(model, Counted) else model
    return np.pi if model.physical or getattr(model, "normalised", False) else 1.0


def lit_sphere(model: Look, size: int = 256) -> Doubles:
    """(size, size, 4) linear R, G, B and coverage of a ball under one light; its grain runs around y."""
    x, y, inside = _disc(2 * size)
    n = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1).reshape(-1, 3)
    n = column_major(n[inside.ravel()])
    l, v = (np.broadcast_to(np.array(a) / np.linalg.norm(a), n.shape) for a in (SUN, (0.0, 0.0, 1.0)))
    t = unit(cross(np.broadcast_to((0.0, 1.0, 0.0), n.shape), n))
    return _halved(values(model, n, column_major(l), column_major(v), t) * irradiance(model), inside)


def lit_plane(model: Look, size: int = 256) -> Doubles:
    """(size / 2, size, 4) linear R, G, B and coverage of a floor seen low, against its lamp.

    Its grain runs from left to right. The light does not fall off with distance.
    """
    # Intersect the rays through twice as many pixels with the floor.
    across, down = np.meshgrid(
        (np.arange(2 * size) + 0.5) / size - 1, 0.32 + 0.68 * (np.arange(size) + 0.5) / size
    )
    eye, forward = np.array(EYE), np.array([0.0, 1.0, 0.0])
    ray = forward + np.stack([0.75 * across, 0 * across, -0.75 * down], axis=-1)
    distance = eye[2] / -ray[..., 2]
    p = (eye + distance[..., None] * ray).reshape(-1, 3)

    # The part of the floor that is drawn.
    inside = (np.abs(p[:, 0]) < 1.5) & (p[:, 1] < 2.6)
    p = column_major(p[inside])
    n, t = (np.broadcast_to(np.array(a), p.shape) for a in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    l, v = unit(column_major(np.array(LAMP) - p)), unit(column_major(eye - p))
    return _halved(values(model, n, l, v, t) * irradiance(model), inside.reshape(across.shape))


def _disc(size: int) -> tuple[Doubles, Doubles, NDArray[np.bool_]]:
    """x, y upwards and whether inside the unit disc, at the centres of size x size pixels."""
    x, y = np.meshgrid((np.arange(size) + 0.5) * 2 / size - 1, 1 - (np.arange(size) + 0.5) * 2 / size)
    return x / 0.98, y / 0.98, x * x + y * y < 0.98**2


def _halved(colors: Doubles, inside: NDArray[np.bool_]) -> Doubles:
    """(H / 2, W / 2, 4) the means of two by two pixels, of which those `inside` have `colors`, (N, 3)."""
    height, width = inside.shape
    pixels = np.zeros((height, width, 4))
    pixels[inside] = np.concatenate([colors, np.ones((len(colors), 1))], axis=1)
    return pixels.reshape(height // 2, 2, width // 2, 2, 4).mean(axis=(1, 3))
