"""Micro-surfaces of published models, and what their own formulas say of them, without rays.

References
----------
Torrance, K. E., Sparrow, E. M. (1967). Theory for off-specular reflection from roughened surfaces. JOSA
57(9).
Oren, M., Nayar, S. K. (1994). Generalization of Lambert's reflectance model. SIGGRAPH '94.
Poulin, P., Fournier, A. (1990). A model for anisotropic reflection. SIGGRAPH '90.
Smith, B. G. (1967). Geometrical shadowing of a random rough surface. IEEE Trans. Antennas Propag. 15(5).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.gonioreflectometer.surface import Surface, height_field

Array = NDArray[np.float64]


# --- surfaces -----------------------------------------------------------------------------------------


def extruded(x: Array, z: Array) -> Surface:
    """The profile z(x), from x[0] to its period x[-1] with equal heights, drawn out along y.

    A tile is eight segments long along y: rays start farther above slender triangles.
    """
    span, along = x[-1] - x[0], 8 * (x[-1] - x[0]) / (len(x) - 1)
    vertices = np.concatenate([np.stack([x - x[0], np.full(len(x), y), z], axis=1) for y in (0.0, along)])
    a = np.arange(len(x) - 1)
    b = a + len(x)
    triangles = np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])
    vertices[:, 2] -= np.trapezoid(z, x) / span
    return Surface(vertices, triangles.astype(np.int32), np.zeros(2), np.array([span, along]), True)


def grooves(slopes: Array, seed: int = 0) -> Surface:
    """V-grooves of width 1 with their upper edges in one plane, in random order; slopes [rad]."""
    slopes = np.random.default_rng(seed).permutation(slopes)
    x = np.arange(2 * len(slopes) + 1) / 2
    z = np.zeros(len(x))
    z[1::2] = -np.tan(slopes) / 2
    return extruded(x, z)


def cylinders(steepest: float, segments: int) -> Surface:
    """Circular arcs side by side, like logs; `steepest` is the slope at their edges [rad]."""
    psi = np.linspace(-steepest, steepest, segments + 1)
    return extruded(np.sin(psi), np.cos(psi))


def gaussian_heights(
    shape: tuple[int, ...], correlation: float, slope: float, seed: int, kind: str = "gaussian"
) -> Array:
    """Periodic Gaussian heights on a grid of unit steps.

    Parameters
    ----------
    shape
        (columns,) of a profile or (rows, columns).
    correlation : float
        Length [steps] at which the correlation of heights is 1/e, or the scale of `kind` matern.
    slope : float
        Root mean square slope of the triangles along x.
    kind : str
        Correlation: `gaussian`, or `matern`, (1 + r + r^2 / 3) exp(-r), of which the slopes are rougher.
    """
    k = np.sqrt(
        sum(np.square(2 * np.pi * f) for f in np.meshgrid(*map(np.fft.fftfreq, shape), indexing="ij"))
    )
    if kind == "gaussian":
        power = np.exp(-((k * correlation) ** 2) / 4)
    else:  # the spectrum of Matern 5/2
        power = (1 / (1 + (k * correlation) ** 2)) ** (2.5 + len(shape) / 2)
    noise = np.fft.fftn(np.random.default_rng(seed).standard_normal(shape))
    z = np.fft.ifftn(noise * np.sqrt(power)).real
    steps = np.roll(z, -1, axis=-1) - z
    return z * (slope / np.sqrt(np.mean(steps**2)))


def gaussian_surface(z: Array) -> Surface:
    """The tile of a height field, or of a profile."""
    if z.ndim == 1:
        return extruded(np.arange(len(z) + 1.0), np.append(z, z[0]))
    return height_field(z, (float(z.shape[1]), float(z.shape[0])))


# --- what formulas say ----------------------------------------------------------------------------------


def torrance_sparrow(n_h: Array, n_l: Array, n_v: Array, v_h: Array) -> Array:
    """G, the share of a V-groove's facet that is lit and seen."""
    return np.clip(2 * n_h * np.minimum(n_l, n_v) / v_h, 0, 1)


def slope_quantiles(count: int, sigma: float) -> Array:
    """Slope angles [rad] at equal steps of Oren and Nayar's c exp(-a^2 / 2 sigma^2) sin(a) da."""
    a = np.linspace(0, min(8 * sigma, 0.499 * np.pi), 20001)
    total = np.cumsum(np.exp(-((a / sigma) ** 2) / 2) * np.sin(a))
    return np.interp((np.arange(count) + 0.5) / count, total / total[-1], a)


def oren_nayar_integral(slopes: Array, l: Array, v: Array, turns: int = 720) -> tuple[Array, Array]:
    """f1 and f2 for an albedo of 1: their integral over slopes and turns, (C,) each.

    A facet a with its opposite b: the lit and seen share of a is Torrance and Sparrow's; in the second order
    the part of b that is lit, from its upper edge, sends to each point of a that is seen the share of a strip
    by Hottel's rule, (sin psi_1 - sin psi_0) / 2.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    phi = (np.arange(turns) + 0.5) * (2 * np.pi / turns)
    first, second = np.zeros(len(l)), np.zeros(len(l))
    cos, sin = np.cos(slopes)[:, None], np.sin(slopes)[:, None]
    gamma = np.cos(np.pi - 2 * slopes)[:, None, None]
    for i, (to_light, to_eye) in enumerate(zip(l, v, strict=True)):
        along_l = (np.cos(phi) * to_light[0] + np.sin(phi) * to_light[1])[None, :] * sin
        along_v = (np.cos(phi) * to_eye[0] + np.sin(phi) * to_eye[1])[None, :] * sin
        l_a, l_b = to_light[2] * cos + along_l, to_light[2] * cos - along_l
        v_a = to_eye[2] * cos + along_v
        lit_a, lit_b, seen_a = (
            np.clip(2 * n * cos / np.maximum(d, 1e-12), 0, 1) * (d > 0)
            for n, d in ((to_light[2], l_a), (to_light[2], l_b), (to_eye[2], v_a))
        )
        both = np.maximum(l_a, 0) * np.maximum(v_a, 0) * np.minimum(lit_a, seen_a)
        scale = np.pi * to_light[2] * to_eye[2]
        first[i] = np.mean(both / cos) / scale

        t = 1 - seen_a[..., None] * (1 - nodes) / 2
        low = 1 - lit_b[..., None]
        near = np.sqrt(np.maximum(t * t + low * low - 2 * t * low * gamma, 1e-300))
        far = np.sqrt(t * t + 1 - 2 * t * gamma)
        strip = ((gamma - t) / far - (low * gamma - t) / near) / 2
        inner = (strip @ weights) * seen_a / 2
        second[i] = np.mean(np.maximum(v_a, 0) * np.maximum(l_b, 0) * inner / cos) / scale
    return first, second


def profile_first_order(x: Array, z: Array, l: Array, v: Array, points: int = 16) -> Array:
    """(C,) f1 for an albedo of 1 of a profile drawn out along y, with all shadows: by sums over points."""
    # Points of the segments, and the highest slope to anything right and left of each.
    share = (np.arange(points) + 0.5) / points
    px = (x[:-1, None] + np.diff(x)[:, None] * share).ravel()
    pz = (z[:-1, None] + np.diff(z)[:, None] * share).ravel()
    period = x[-1] - x[0]
    vx = np.concatenate([x[:-1] + k * period for k in range(-4, 5)])
    vz = np.tile(z[:-1], 9)
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = (vz[None, :] - pz[:, None]) / (vx[None, :] - px[:, None])
    is_right = vx[None, :] > px[:, None]
    right = np.where(is_right, rise, -np.inf).max(axis=1)
    left = np.where(~is_right, -rise, -np.inf).max(axis=1)

    # Sum over them.
    slope = np.repeat(np.diff(z) / np.diff(x), points)
    normal = np.stack([-slope, np.zeros_like(slope), np.ones_like(slope)]) / np.sqrt(1 + slope**2)
    area = np.repeat(np.hypot(np.diff(x), np.diff(z)), points) / points / period
    out = np.empty(len(l))
    for i, pair in enumerate(zip(l, v, strict=True)):
        total = area.copy()
        for d in pair:
            open_ = np.where(d[0] >= 0, d[2] > right * d[0], d[2] > -left * d[0])
            total = total * np.maximum(d @ normal, 0) * open_
        out[i] = total.sum() / (np.pi * pair[0][2] * pair[1][2])
    return out


def smith_lambda(slope: float, theta: Array) -> Array:
    """Smith's Lambda of a Gaussian surface with this root mean square slope along a direction."""
    from math import erfc

    nu = 1 / (np.tan(theta) * slope * np.sqrt(2))
    return np.exp(-nu * nu) / (2 * nu * np.sqrt(np.pi)) - np.array([erfc(each) for each in nu]) / 2


def beckmann(slope: float, theta: Array) -> Array:
    """D of a Gaussian surface [1/sr]."""
    alpha2 = 2 * slope**2
    return np.exp(-(np.tan(theta) ** 2) / alpha2) / (np.pi * alpha2 * np.cos(theta) ** 4)


def in_plane(theta: Array, azimuth: float = 0.0) -> Array:
    """(N, 3) directions by signed angles to the normal [rad], at an azimuth."""
    return np.stack([np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)], axis=1)
