"""Bodies for tests of rays."""

from __future__ import annotations

import numpy as np
import pytest


def icosphere(level):
    """(V, 3) float64 on the unit sphere and (F, 3) int32: an icosahedron split `level` times."""
    g = (1 + 5**0.5) / 2
    v = np.array([[s * a, t * b, 0.0] for a, b in ((1, g),) for s in (-1, 1) for t in (-1, 1)])
    v = np.concatenate([v, np.roll(v, 1, axis=1), np.roll(v, 2, axis=1)])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    near = np.linalg.norm(v[:, None] - v[None], axis=2) < 1.1
    f = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    f = np.array([t if np.linalg.det(v[list(t)]) > 0 else t[::-1] for t in f])
    for _ in range(level):
        edges = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        middle = v[unique].mean(axis=1)
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        a, b, c = (len(v) + inverse.ravel()).reshape(3, -1)
        v = np.concatenate([v, middle])
        split = (f[:, 0], a, c), (f[:, 1], b, a), (f[:, 2], c, b), (a, b, c)
        f = np.concatenate([np.stack(t, axis=1) for t in split])
    return v, f.astype(np.int32)


@pytest.fixture(scope="session")
def ball():
    return icosphere(4)


@pytest.fixture(scope="session")
def bodies():
    """Convex bodies: no ray that leaves through the front can hit anything."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    box = corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    v, f = icosphere(5)
    w, g = icosphere(3)
    place = np.array([0.6, -0.5, 0.55])
    return {
        "box": box,
        "ball": (v, f),
        "needle 1000:1": (v * [1, 1e-3, 1], f),
        "small box far off": (box[0] * 5e-4 + place, box[1]),
        "small ball far off": (w * 5e-4 + place, g),
    }
