"""Bent normals and thickness against closed forms, thickness against its own stated error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.visibility.baked import read_npz

SEEDS = 8
FAR = 300.0
"""Extent of walls that closed forms have without end: what they lack is below the error."""


def baked(path, **settings):
    """The channels of a mesh, and the report of its bake."""
    out = path.with_suffix(".npz")
    settings = BakeSettings(**settings)
    _, report = bake_mesh(path, [out], settings, BakeOptions(threads=2, force=True))
    return read_npz(out).channels, report


def rectangle(corners):
    """Four corners, counter-clockwise."""
    return list(corners), [(0, 1, 2, 3)]


def mesh_of(path, *parts):
    """An OBJ of parts, each vertices and faces; vertex 0 is that of the first part."""
    lines, first = [], 1
    for vertices, faces in parts:
        lines += ["v " + " ".join(f"{float(x):.9g}" for x in vertex) for vertex in vertices]
        lines += ["f " + " ".join(str(first + k) for k in face) for face in faces]
        first += len(vertices)
    path.write_text("\n".join(lines))
    return path


def floor(z=0.0, left=-FAR):
    """A floor that faces +z, from x = `left` on. Vertex 0 is over the origin, and has small triangles: rays
    start within 1/256 of their edges."""
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    inner, outer = 0.1 * square, FAR * square
    outer[:, 0] = np.maximum(outer[:, 0], left)
    sides = [(k, (k + 1) % 4) for k in range(4)]
    faces = [(0, 1 + a, 1 + b) for a, b in sides] + [(1 + a, 5 + a, 5 + b, 1 + b) for a, b in sides]
    return [(x, y, z) for x, y in [(0, 0), *inner, *outer]], faces


def ball(radius, center, rows=48):
    """A sphere of quads, whose vertices are on it."""
    polar = np.linspace(0, math.pi, rows + 1)[1:-1]
    around = np.arange(2 * rows) * math.pi / rows
    ring = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=1)
    rings = [math.sin(t) * ring + [0, 0, math.cos(t)] for t in polar]
    vertices = np.concatenate([[[0, 0, 1]], *rings, [[0, 0, -1]]]) * radius + center
    count, last = len(around), len(vertices) - 1
    faces = [(0, 1 + k, 1 + (k + 1) % count) for k in range(count)]
    for row in range(len(polar) - 1):
        a, b = 1 + row * count, 1 + (row + 1) * count
        faces += [(a + k, b + k, b + (k + 1) % count, a + (k + 1) % count) for k in range(count)]
    bottom = 1 + (len(polar) - 1) * count
    faces += [(bottom + (k + 1) % count, bottom + k, last) for k in range(count)]
    return list(vertices), faces


# ------------------------------------------------------------------ bent normals


def lune(end):
    """Mean direction, weighted by the cosine, of those whose angle b from +x to +z about y is below `end`.

    The integral of d (d.z) with d = (sin a cos b, cos a, sin a sin b), a from 0 to pi, b from 0 to `end`.
    """
    return np.array([math.sin(end) ** 2 / 2, 0, end / 2 - math.sin(2 * end) / 4])


def beside_a_wall(height):
    """A floor, and at x = -1 a wall that faces it."""
    wall = [(-1, -FAR, 0), (-1, FAR, 0), (-1, FAR, height), (-1, -FAR, height)]
    return [floor(), rectangle(wall)], lune(math.pi - math.atan(height))


def under_a_ceiling(height):
    """A floor, and over x < 0 a ceiling that faces it."""
    ceiling = [(0, -FAR, height), (-FAR, -FAR, height), (-FAR, FAR, height), (0, FAR, height)]
    return [floor(), rectangle(ceiling)], lune(math.pi / 2)


def beside_a_ball(distance):
    """A floor, and a ball of radius 1 that touches it at x = `distance`: an occluder that is a cone.

    The mean is the integral of d (d.z) over the hemisphere without that over the cone, half the angle of
    which is a: with P = integral of (d.u)^2 = 2 pi (1 - cos^3 a) / 3 about its axis u, the tensor of d d is
    P u u + (2 pi (1 - cos a) - P) / 2 (1 - u u).
    """
    axis = np.array([distance, 0, 1]) / math.hypot(distance, 1)
    cosine = math.sqrt(1 - 1 / (distance**2 + 1))
    along = 2 * math.pi * (1 - cosine**3) / 3
    across = (2 * math.pi * (1 - cosine) - along) / 2
    cone = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    return [floor(), ball(1, (distance, 0, 1))], np.array([0, 0, 2 * math.pi / 3]) - cone[2]


@pytest.mark.parametrize(
    ("case", "size"),
    [
        (beside_a_wall, 1e-2),
        (beside_a_wall, 1),
        (beside_a_wall, 20),
        (under_a_ceiling, 0.5),
        (beside_a_ball, 2),
    ],
)
def test_bent_normals_are_those_of_closed_forms(tmp_path, case, size):
    parts, mean = case(size)
    path = mesh_of(tmp_path / "a.obj", *parts)
    seeds = [baked(path, what=("bent_normal",), samples=1024, seed=seed)[0] for seed in range(SEEDS)]
    found = np.array([channels["bent_normal"][0] for channels in seeds], float)
    error = np.hypot(
        found.std(axis=0, ddof=1) / SEEDS**0.5, 1e-4
    )  # and of floats, offsets, the ball's polygons
    assert (np.abs(found.mean(axis=0) - mean / np.linalg.norm(mean)) < 4 * error).all()


def test_a_bent_normal_is_the_normal_where_nothing_is_open(tmp_path):
    vertices, faces = floor(z=0.01)
    path = mesh_of(tmp_path / "a.obj", floor(), (vertices, [face[::-1] for face in faces]))
    channels, _ = baked(path, what=("ao", "bent_normal"), samples=64)
    assert channels["obscurance"][0] == 0
    assert channels["bent_normal"][0].tolist() == [0, 0, 1]


# ------------------------------------------------------------------ thickness


def slab(limit):
    """Of thickness 1: the mean of min(1 / c, limit), where c has the density 2 c, is 2 - 1 / limit."""
    vertices, faces = floor(z=-1)
    return [floor(), (vertices, [face[::-1] for face in faces])], 2 - 1 / limit


def sheet(limit):
    """Nothing beneath: the limit."""
    return [floor()], limit


def edge(limit):
    """A quarter of space, at distance 1 from its edge. Half of the rays never leave; x, how far the others
    lean, has the density 2 sqrt(1 - x^2) / pi, and they have min(1 / x, limit)."""
    root = math.sqrt(1 - 1 / limit**2)
    inner = (math.asin(1 / limit) + root / limit) * limit / 2
    outer = math.log((1 + root) * limit) - root
    wall = rectangle([(-1, FAR, 0), (-1, FAR, -FAR), (-1, -FAR, -FAR), (-1, -FAR, 0)])
    return [floor(left=-1.0), wall], limit / 2 + 2 / math.pi * (inner + outer)


@pytest.mark.parametrize("case", [slab, sheet, edge])
@pytest.mark.parametrize("limit", [1.5, 40.0])
def test_thickness_is_that_of_closed_forms(tmp_path, case, limit):
    parts, truth = case(limit)
    path = mesh_of(tmp_path / "a.obj", *parts)
    falloff = {"falloff": "step", "max_distance": limit}
    found = [
        baked(path, what=("thickness",), samples=256, seed=seed, falloff=falloff)[0] for seed in range(SEEDS)
    ]
    values = np.array([channels["thickness"][0] for channels in found], float)
    error = math.hypot(values.std(ddof=1) / SEEDS**0.5, 2e-4)  # and of floats, offsets, where rays start
    assert abs(values.mean() - truth) < 4 * error


def test_a_sheet_without_a_back_is_told(tmp_path):
    path = mesh_of(tmp_path / "a.obj", rectangle([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]))
    falloff = {"falloff": "step", "max_distance": 0.5}
    channels, report = baked(path, what=("thickness",), falloff=falloff)
    assert (channels["thickness"] == 0.5).all()
    assert (channels["thickness_error"] == 0).all()
    assert report.warnings == [
        "nothing is behind 4 points, as on open sheets: their thickness is the limit, 0.5"
    ]


def test_thickness_of_a_ball_is_four_thirds_of_its_radius(tmp_path):
    vertices, faces = ball(1, (0, 0, 0))
    path = mesh_of(tmp_path / "ball.obj", (vertices, faces))
    channels, report = baked(path, what=("ao", "thickness"), samples=64)
    flat = np.linalg.norm(
        np.mean([np.array(vertices)[list(face)] for face in faces if len(face) == 4], axis=1), axis=1
    )
    z = (channels["thickness"] - 4 / 3) / channels["thickness_error"]
    assert 4 / 3 * flat.min() < channels["thickness"].mean() < 4 / 3
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.2
    assert report.sampled["thickness"].rmse == pytest.approx(channels["thickness"].std(), rel=0.2)
    assert (channels["obscurance"] == 1).all()
