"""RGL files made to the specification: of noise, and of a known BRDF; and their evaluation, point by point.

The evaluation and the warp are written from the paper and the authors' code, in plain numbers.
"""

from __future__ import annotations

import itertools
import math
import struct
from bisect import bisect_right

import numpy as np

TYPES = {"|u1": 1, "<u2": 3, "<u4": 5, "<f2": 9, "<f4": 10, "<f8": 11}
THETAS = [0.0, 0.5, 0.8, 1.05, 1.25, 1.4, 1.5, np.pi / 2]


def tensor_file(fields):
    """The bytes of a tensor file; fields are arrays by name."""
    size = 18 + sum(13 + len(name) + 8 * np.ndim(values) for name, values in fields.items())
    head, body = b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)), b""
    for name, values in fields.items():
        values = np.asarray(values)
        kind = TYPES[values.dtype.newbyteorder("<").str]
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack(f"<HBQ{values.ndim}Q", values.ndim, kind, size + len(body), *values.shape)
        body += values.astype(values.dtype.newbyteorder("<")).tobytes()
        body += b"\0" * (-len(body) % 8)
    return head + body


def measurement(ndf, sigma, vndf, rgb, thetas=THETAS, divided=1):
    """All fields of an isotropic measurement: `ndf`, `sigma` (U,), `vndf` (S, A, U), `rgb` (S, 3, Y, X)."""
    luminance = np.tensordot([0.2126, 0.7152, 0.0722], rgb, (0, 1))
    text = np.frombuffer(b"synthetic", np.uint8)
    numbers = {
        "theta_i": thetas, "phi_i": [0], "sigma": [sigma, sigma], "ndf": [ndf, ndf], "vndf": [vndf],
        "luminance": [luminance], "rgb": [rgb],
    }  # fmt: skip
    floats = {name: np.array(values, np.float32) for name, values in numbers.items()}
    return {"description": text, **floats, "jacobian": np.array([divided], np.uint8)}


def noise(seed=1, thetas=THETAS, divided=1):
    """Fields of random numbers, some of `rgb` negative, some rows of `vndf` black."""
    random = np.random.default_rng(seed)
    count = len(thetas)
    vndf = random.random((count, 9, 12)) ** 3
    vndf[-1, 3:6] = 0
    rgb = random.random((count, 3, 6, 5)) - 0.1
    return measurement(random.random(14) * 9, random.random(11) + 0.1, vndf, rgb, thetas, divided)


# -- a known BRDF: rough metal beside white


ALPHA = 0.35


def ggx(cos2):
    """GGX's density of normals at a squared cosine."""
    return ALPHA**2 / (np.pi * (cos2 * (ALPHA**2 - 1) + 1) ** 2)


def smith(cosine):
    """GGX's G1."""
    return 2 / (1 + np.sqrt(1 + ALPHA**2 * (1 / cosine**2 - 1)))


def known(eye, light):
    """(3,) BRDF times the cosine at the light."""
    half = np.add(eye, light)
    half /= np.linalg.norm(half)
    metal = ggx(half[2] ** 2) * smith(eye[2]) * smith(light[2]) / (4 * eye[2])
    return metal * np.array([0.9, 0.6, 0.3]) + light[2] / np.pi * np.array([0.1, 0.2, 0.3])


def of_known(grid=16, warp=64):
    """Fields of a measurement of `known`; what is not seen is 0, as in the database."""
    # Distributions on the grids of angles.
    u = np.linspace(0, 1, warp)
    theta = u**2 * np.pi / 2
    phi = np.linspace(-np.pi, np.pi, warp)
    cosine = np.maximum(np.cos(theta), 1e-3)
    ndf, sigma = ggx(cosine**2), cosine / smith(cosine)
    thetas = np.array(THETAS)[:, None, None]
    seen = np.maximum(np.sin(thetas) * np.sin(theta) * np.cos(phi)[:, None] + np.cos(thetas) * cosine, 0)
    vndf = ndf * seen * u * np.sin(theta) + 1e-6
    fields = measurement(ndf, sigma, vndf, np.zeros((len(THETAS), 3, 2, 2)))

    # The BRDF at the nodes, as a device that follows the warp measures it.
    rgb = np.zeros((len(THETAS), 3, grid, grid), np.float32)
    for k, row, column in np.ndindex(len(THETAS), grid, grid):
        eye, light, u_m = node(fields, k, column / (grid - 1), row / (grid - 1))
        if light[2] > 0 and eye[2] > 1e-3:
            scale = 4 * line(sigma, math.sqrt(THETAS[k] / (np.pi / 2))) / line(ndf, u_m)
            rgb[k, :, row, column] = known(eye, light) * scale
    return {**fields, "rgb": rgb[None]}


def node(fields, k, x, y):
    """Eye, light and the root coordinate of the half vector, which the warp of angle `k` makes of (x, y)."""
    u_m, turn = warped(fields["vndf"][0, k].astype(float), x, y)
    theta, phi = u_m**2 * np.pi / 2, (2 * turn - 1) * np.pi
    half = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    eye = np.array([np.sin(THETAS[k]), 0, np.cos(THETAS[k])])
    return eye, 2 * (eye @ half) * half - eye, u_m


# -- the authors' evaluation, in double precision


def warped(density, x, y):
    """The column and row, 0 to 1, to which the warp of a density, (A, U), moves (x, y)."""
    along, whole, marginal = integrals(density)
    row = max(min(bisect_right(marginal, y * marginal[-1]) - 1, len(density) - 2), 0)
    part = root(whole[row], whole[row + 1], y * marginal[-1] - marginal[row])
    mixed = (1 - part) * along[row] + part * along[row + 1]
    target = x * mixed[-1]
    column = max(min(bisect_right(mixed.tolist(), target) - 1, density.shape[1] - 2), 0)
    values = (1 - part) * density[row] + part * density[row + 1]
    across = root(values[column], values[column + 1], target - mixed[column])
    return (column + across) / (density.shape[1] - 1), (row + part) / (len(density) - 1)


def root(first, second, area):
    """t with the integral of first + t (second - first) from 0 to t equal to `area`, within 0 to 1."""
    inner = math.sqrt(max(first**2 + 2 * area * (second - first), 0))
    return min(max(2 * area / (first + inner), 0), 1) if first + inner > 0 else 0.0


def integrals(density):
    """Integrals of a density: along each row, of whole rows, across rows."""
    along = np.pad(np.cumsum((density[:, 1:] + density[:, :-1]) / 2, axis=1), ((0, 0), (1, 0)))
    whole = along[:, -1].tolist()
    return along, whole, [0.0, *itertools.accumulate((a + b) / 2 for a, b in itertools.pairwise(whole))]


def line(table, u):
    """A table over 0 to 1, interpolated."""
    place = min(max(u, 0), 1) * (len(table) - 1)
    low = min(int(place), len(table) - 2)
    return table[low] + (place - low) * (table[low + 1] - table[low])


def bilinear(table, x, y):
    return line([line(row, x) for row in table], y)


def evaluated(fields, eye, light):
    """(3,) the BRDF times the cosine at the light, for unit vectors about z."""
    half = np.add(eye, light)
    half /= np.linalg.norm(half)
    theta_v, theta_h = math.acos(min(eye[2], 1)), math.acos(min(half[2], 1))
    turn = (math.atan2(half[1], half[0]) - math.atan2(eye[1], eye[0]) + math.pi) / (2 * math.pi)
    u_v, u_h, turn = math.sqrt(theta_v * 2 / math.pi), math.sqrt(theta_h * 2 / math.pi), turn % 1

    # Both tables at this angle of the eye; every density with an integral of 1.
    thetas = fields["theta_i"].astype(float).tolist()
    low = max(min(bisect_right(thetas, theta_v) - 1, len(thetas) - 2), 0)
    high = min(low + 1, len(thetas) - 1)
    weight = min(max((theta_v - thetas[low]) / (thetas[high] - thetas[low]), 0), 1) if high > low else 0
    density, rgb = (
        (1 - weight) * values[low] + weight * values[high]
        for values in (
            np.array([each / integrals(each)[2][-1] for each in fields["vndf"][0].astype(float)]),
            fields["rgb"][0].astype(float),
        )
    )

    # Where the warp moves the half vector from.
    along, whole, marginal = integrals(density)
    y = min(max(turn, 0), 1) * (len(density) - 1)
    x = min(max(u_h, 0), 1) * (density.shape[1] - 1)
    row, column = min(int(y), len(density) - 2), min(int(x), density.shape[1] - 2)
    y, x = y - row, x - column
    here, following = ((1 - y) * density[row, c] + y * density[row + 1, c] for c in (column, column + 1))
    part = (1 - y) * along[row, column] + y * along[row + 1, column] + x * (here + x / 2 * (following - here))
    whole_row = (1 - y) * whole[row] + y * whole[row + 1]
    from_x = part / whole_row if whole_row else 0.0
    from_y = marginal[row] + y * (whole[row] + y / 2 * (whole[row + 1] - whole[row]))

    values = np.array([bilinear(channel, from_x, from_y) for channel in rgb])
    if fields["jacobian"][0]:
        values *= line(fields["ndf"][0].astype(float), u_h)
        values /= 4 * line(fields["sigma"][0].astype(float), u_v)
    return np.maximum(values, 0)
