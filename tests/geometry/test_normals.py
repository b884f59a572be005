from __future__ import annotations

import json
import lzma
from dataclasses import replace
from importlib.resources import files
from itertools import product

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.geometry import polygon_normals as polygon_normals_module
from illumcli.geometry.corner_normals import corner_normals
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import area_vectors, polygon_normals, reversed_polygons
from illumcli.geometry.single_normals import (
    cross_normal,
    edge_average_normal,
    newell_plane,
    plane_solve,
    vertex_normal,
)

FORMULAS = {
    "polygon_normal_cross": cross_normal,
    "polygon_normal_edge_average": edge_average_normal,
    "newell_plane": newell_plane,
    "plane_solve": plane_solve,
    "vertex_normal": vertex_normal,
}
METHODS = ("newell", "cross", "edge_average", "plane")
CORNER = np.ones(3) / np.sqrt(3)


def cases():
    text = lzma.decompress((files("illumcli") / "data/vectors/textbook.json.xz").read_bytes())
    return [pytest.param(c, id=c["id"]) for c in json.loads(text) if c["model"] in FORMULAS]


def ragged(*polygons, vertices, **more):
    starts = np.cumsum([0, *map(len, polygons)]).astype(np.int32)
    return Mesh(np.array(vertices, float), np.concatenate(polygons).astype(np.int32), starts, **more)


CUBE = np.array(list(product((0.0, 1.0), repeat=3)))
SIDES = ([0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3])


def cube(**more):
    return ragged(*SIDES, vertices=CUBE, **more)


@pytest.mark.parametrize("case", cases())
def test_the_reference_vectors(case):
    value, expected = FORMULAS[case["model"]](**case["inputs"]), np.array(case["expected"])
    assert np.abs(value - expected).max() <= case["atol"] + case["rtol"] * np.abs(expected).max()


@pytest.mark.parametrize("method", METHODS)
def test_polygons_of_all_sizes_at_once(method):
    pentagon = [[0, 0, 0], [2, 0, 0], [3, 2, 0], [1, 3, 0], [-1, 2, 0]]
    mesh = ragged([0, 1, 2], [0, 1, 2, 3, 4], [4, 3, 2, 1], vertices=pentagon)
    np.testing.assert_allclose(polygon_normals(mesh, method), [[0, 0, 1], [0, 0, 1], [0, 0, -1]], atol=1e-15)
    np.testing.assert_allclose(area_vectors(mesh)[:, 2], [4, 16, -12], rtol=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_a_polygon_without_area_has_no_normal(method):
    line = [[0.1, 0.3, 0.7], [0.3, 0.9, 2.1], [0.7, 2.1, 4.9], [0.1, 0.3, 0.5]]
    mesh = ragged([0, 1, 2], [0, 1, 1], [0, 1, 2, 1], [0, 2, 3], vertices=line)
    normals = polygon_normals(mesh, method)
    np.testing.assert_array_equal(normals[:3], 0)
    assert np.linalg.norm(normals[3]) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("method", METHODS)
def test_a_straight_first_corner_leaves_no_hole(method):
    mesh = ragged([0, 1, 2, 3, 4], vertices=[[1, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 0]])
    np.testing.assert_allclose(polygon_normals(mesh, method), [[0, 0, 1]], atol=1e-15)
    mesh = ragged([0, 1, 2, 3, 4], vertices=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    np.testing.assert_allclose(polygon_normals(mesh, method), [[0, 0, 1]], atol=1e-15)


def test_newell_and_the_plane_know_the_side_of_a_concave_polygon():
    arrow = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]]
    for start in range(5):
        mesh = ragged(np.roll(range(5), start), vertices=arrow)
        for method in ("newell", "plane"):
            np.testing.assert_allclose(polygon_normals(mesh, method), [[0, 0, 1]], atol=1e-15)
    reflex_first = ragged([3, 4, 0, 1, 2], vertices=arrow)
    np.testing.assert_allclose(polygon_normals(reflex_first, "cross"), [[0, 0, -1]], atol=1e-15)


@given(
    hnp.arrays(float, (6, 3), elements=st.integers(-50, 50).map(float)),
    st.integers(0, 5),
    hnp.arrays(float, 3, elements=st.integers(-1000, 1000).map(float)),
)
def test_newell_ignores_where_the_polygon_starts_and_stands(points, start, offset):
    here = ragged(range(6), vertices=points)
    there = ragged(np.roll(range(6), start), vertices=points + offset)
    np.testing.assert_allclose(area_vectors(here), area_vectors(there), atol=1e-9)
    flipped = ragged(range(6)[::-1], vertices=points)
    np.testing.assert_allclose(area_vectors(flipped), -area_vectors(here), atol=1e-9)


@given(st.lists(st.booleans(), min_size=6, max_size=6), st.lists(st.booleans(), min_size=6, max_size=6))
def test_angle_weights_give_a_cube_corner_its_diagonal_however_it_is_cut(cut, other_diagonal):
    polygons = []
    for side, split, other in zip(SIDES, cut, other_diagonal, strict=True):
        a, b, c, d = np.roll(side, int(other))
        polygons += [[a, b, c], [a, c, d]] if split else [[a, b, c, d]]
    made = corner_normals(ragged(*polygons, vertices=CUBE), crease=180.0)
    np.testing.assert_allclose(made.normals, (2 * CUBE - 1) / np.sqrt(3), atol=1e-15)


def test_a_reflex_corner_counts_more_than_half_a_turn():
    """An L-shaped floor with a wall in its reflex corner, whole and cut in triangles."""
    points = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0], [1, 1, 1], [2, 1, 1]]
    wall = [3, 2, 7, 6]  # faces -y
    whole = corner_normals(ragged([0, 1, 2, 3, 4, 5], wall, vertices=points), crease=180.0)
    parts = ragged([0, 1, 3], [1, 2, 3], [3, 4, 0], [4, 5, 0], wall, vertices=points)
    cut = corner_normals(parts, crease=180.0)
    np.testing.assert_allclose(whole.normals[3], cut.normals[3], atol=1e-15)
    tilted = np.array([0, -1, 3]) / np.sqrt(10)  # a quarter turn of wall, three of floor
    np.testing.assert_allclose(whole.normals[3], tilted, atol=1e-15)


@pytest.mark.parametrize("weights", ["equal", "area", "angle"])
def test_a_crease_keeps_the_faces_of_a_box_flat(weights):
    flat = corner_normals(cube(), weights, crease=89.9)
    own = np.repeat(polygon_normals(cube()), 4, axis=0)
    np.testing.assert_allclose(flat.normals[flat.index], own, atol=1e-15)
    round_ = corner_normals(cube(), weights, crease=90.0)
    smooth = corner_normals(cube(), weights, crease=180.0)
    np.testing.assert_allclose(round_.normals[round_.index], smooth.normals[smooth.index], atol=1e-15)


def around_an_apex(*degrees, closed=False):
    """Facets round a vertex high above a rim whose points stand at these angles."""
    angle = np.radians(degrees)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    last = len(rim)
    fan = [[last, i, (i + 1) % last] for i in range(last if closed else last - 1)]
    return ragged(*fan, vertices=[*rim, [0.0, 0.0, 50.0]])


def at_the_apex(mesh, **how):
    made = corner_normals(mesh, "equal", **how)
    return made.normals[made.index[::3]]


def mean(normals):
    total = normals.sum(axis=0)
    return total / np.linalg.norm(total)


def test_a_vertex_is_split_at_its_sharp_edges():
    """Five facets about 10 degrees apart but for one edge of 35, and one fan of them to each side of it."""
    mesh = around_an_apex(0, 10, 20, 30, 90, 100)
    facets = polygon_normals(mesh)
    sharp, smooth = at_the_apex(mesh, crease=20.0), at_the_apex(mesh, crease=40.0)
    np.testing.assert_allclose(sharp[:3], np.tile(mean(facets[:3]), (3, 1)), atol=1e-12)
    np.testing.assert_allclose(sharp[3:4], facets[3:4], atol=1e-12)
    np.testing.assert_allclose(smooth, np.tile(mean(facets), (5, 1)), atol=1e-12)


def test_one_sharp_edge_alone_splits_nothing():
    """Round a closed fan the polygons of either side follow each other the other way."""
    mesh = around_an_apex(0, 85, 170, 195, 280, 305, closed=True)
    facets = polygon_normals(mesh)
    turns = np.degrees(np.arccos((facets * np.roll(facets, 1, axis=0)).sum(axis=1)))
    assert np.count_nonzero(turns > 75) == 1
    np.testing.assert_allclose(at_the_apex(mesh, crease=75.0), np.tile(mean(facets), (6, 1)), atol=1e-12)


def prism(sides, chamfer=0.0):
    """A prism with its edges at the ends cut off at 45 degrees."""
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    levels = [(1.0, 0.0), (1.0, 1.0)]
    if chamfer:
        inner = 1 - chamfer / np.cos(np.pi / sides)
        levels = [(inner, 0.0), (1.0, chamfer), (1.0, 1 - chamfer), (inner, 1.0)]
    vertices = np.concatenate([ring * [r, r, 0] + [0, 0, z] for r, z in levels])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [
        [k * sides + a, k * sides + b, (k + 1) * sides + b, (k + 1) * sides + a]
        for k in range(len(levels) - 1)
        for a, b in zip(i.tolist(), j.tolist(), strict=True)
    ]
    ends = [list(range(sides))[::-1], list(range(len(vertices) - sides, len(vertices)))]
    return ragged(*faces, *ends, vertices=vertices)


@pytest.mark.parametrize(
    ("sides", "is_round"), [(4, False), (6, False), (8, False), (9, True), (12, True), (64, True)]
)
@pytest.mark.parametrize("chamfer", [0.0, 0.1])
def test_edges_of_parts_are_sharp_and_coarse_cylinders_round_by_default(sides, is_round, chamfer):
    mesh = prism(sides, chamfer)
    made = corner_normals(mesh)
    corner, size = made.normals[made.index], np.diff(mesh.starts)
    own = np.repeat(polygon_normals(mesh), size, axis=0)
    is_end = np.repeat(size == sides, size) & (np.abs(own[:, 2]) > 0.99)
    np.testing.assert_allclose(corner[is_end], own[is_end], atol=1e-12)
    upright = np.abs(own[:, 2]) < 0.01
    np.testing.assert_allclose(corner[upright][:, 2], 0, atol=1e-12)
    radial = mesh.vertices[mesh.corners[upright]] * [1, 1, 0]
    wanted = radial / np.linalg.norm(radial, axis=1)[:, None] if is_round else own[upright]
    np.testing.assert_allclose(corner[upright], wanted, atol=1e-12)


def test_smoothing_groups_say_what_is_averaged_whatever_the_angle():
    """Sides of a cube: two share a group, one has one of its own, one is flat, two are not spoken of."""
    groups = np.array([1, 1, 2, 0, -1, -1], np.int32)
    mesh = cube(polygon_smoothing=groups)
    made = corner_normals(mesh)
    own = polygon_normals(mesh)
    corner = made.normals[made.index].reshape(6, 4, 3)
    np.testing.assert_allclose(corner[2:], np.repeat(own[2:, None], 4, axis=1), atol=1e-12)
    shared = cube(polygon_smoothing=np.array([1, 3, 1, 0, 3, -1], np.int32))
    made = corner_normals(shared)
    corner, at = made.normals[made.index].reshape(6, 4, 3), shared.corners.reshape(6, 4)
    for side, beside in ((0, 2), (2, 0), (1, 4), (4, 1)):
        meets = np.isin(at[side], at[beside])
        assert np.count_nonzero(meets) == 2
        np.testing.assert_allclose(
            corner[side][meets], np.tile(mean(own[[side, beside]]), (2, 1)), atol=1e-12
        )
        np.testing.assert_allclose(corner[side][~meets], np.tile(own[side], (2, 1)), atol=1e-12)
    by_angle = corner_normals(shared, crease=180.0)
    np.testing.assert_allclose(by_angle.normals[by_angle.index[0]], -CORNER)
    own_normals = replace(shared, normals=own, corner_normals=np.repeat(range(6), 4).astype(np.int32))
    kept = corner_normals(own_normals)
    np.testing.assert_allclose(kept.normals[kept.index], np.repeat(own, 4, axis=0))


def test_the_files_normals_are_kept_and_the_bad_ones_replaced():
    own = np.array([[0, 0, 3.0], [0, 0, 0], [np.nan, 0, 1], [1e-200, 0, 0]])
    mesh = cube(normals=own, corner_normals=np.array([0, 1, 2, 3] + [0] * 20, np.int32))
    made = corner_normals(mesh, crease=180.0)
    corner = made.normals[made.index]
    np.testing.assert_array_equal(corner[[0, 3, 4]], [[0, 0, 1], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(corner[1:3], (2 * CUBE[[1, 3]] - 1) / np.sqrt(3))
    assert made.repairs == {"zero or non-finite normals": 2}
    ignored = corner_normals(mesh, crease=180.0, use_file=False)
    np.testing.assert_allclose(ignored.normals[ignored.index[0]], -CORNER)


def test_corners_without_a_normal_of_the_file_are_computed_and_not_called_bad():
    own = 3 * polygon_normals(cube())
    mesh = cube(normals=own, corner_normals=np.array([-1, *np.repeat(range(6), 4)[1:]], np.int32))
    made = corner_normals(mesh, crease=180.0)
    np.testing.assert_allclose(made.normals[made.index[0]], -CORNER)
    assert made.repairs == {}


def test_two_sheets_back_to_back_keep_their_own_sides():
    mesh = ragged([0, 1, 2], [2, 1, 0], vertices=[[0.1, 0, 0], [1, 0.3, 0], [0, 1, 0.7]])
    for crease, repairs in ((180.0, {"vertices whose polygons cancel": 6}), (None, {})):
        made = corner_normals(mesh, crease=crease)
        np.testing.assert_allclose(
            made.normals[made.index], np.repeat(polygon_normals(mesh), 3, axis=0), atol=1e-15
        )
        assert made.repairs == repairs


def test_a_degenerate_polygon_weighs_nothing_and_alone_has_no_normal():
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [5, 5, 5], [6, 6, 6], [7, 7, 7]]
    made = corner_normals(ragged([0, 1, 2], [0, 3, 1], [4, 5, 6], vertices=points))
    np.testing.assert_allclose(made.normals[made.index[[0, 1, 2, 3, 5]]], [[0, 0, 1]] * 5)
    assert made.index[[4, 6, 7, 8]].tolist() == [-1] * 4


def test_a_mesh_far_from_the_origin_keeps_its_normals():
    near, far = polygon_normals(cube()), polygon_normals(ragged(*SIDES, vertices=CUBE + 2.0**40))
    np.testing.assert_array_equal(near, far)


def test_an_empty_mesh_has_none():
    empty = Mesh(np.zeros((2, 3)), np.zeros(0, np.int32), np.zeros(1, np.int32))
    for crease in (None, 30.0):
        assert corner_normals(empty, crease=crease).index.shape == (0,)
    assert polygon_normals(empty, "plane").shape == (0, 3)


def leaning(*normals, faces=((0, 1, 2, 3),)):
    """A square in the plane z = 0, seen counter-clockwise from above, with a normal per vertex."""
    corners = np.concatenate(faces).astype(np.int32)
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    return ragged(*faces, vertices=square, normals=np.array(normals, float), corner_normals=corners)


def test_polygons_are_reversed_only_where_every_normal_is_clearly_on_the_other_side():
    down, level, bad = [0.3, 0, -1], [1, 0, -0.005], [0, 0, 0]
    assert reversed_polygons(leaning(down, down, down, down)).tolist() == [True]
    assert reversed_polygons(leaning(down, down, down, [1, 0, 0.2])) is None
    assert reversed_polygons(leaning(down, down, down, level)) is None
    assert reversed_polygons(leaning(down, down, down, bad)) is None
    assert reversed_polygons(cube()) is None
    lacking = leaning(down, down, down, down)
    assert reversed_polygons(replace(lacking, corner_normals=np.array([0, 1, 2, -1], np.int32))) is None
    both = leaning(down, down, down, [0, 0, -1], faces=((0, 1, 2, 3), (3, 2, 1, 0)))
    assert reversed_polygons(both).tolist() == [True, False]


def test_computed_normals_of_reversed_polygons_lie_on_the_side_of_the_files():
    square = leaning(*[[0.1, 0, -1]] * 4)
    loose = [[2, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0]]
    mesh = replace(
        square,
        vertices=np.concatenate([square.vertices, loose]),
        corners=np.arange(8, dtype=np.int32),
        starts=np.array([0, 4, 8], np.int32),
        corner_normals=np.array([0, 1, 2, 3, -1, -1, -1, -1], np.int32),
    )
    found = corner_normals(mesh)
    np.testing.assert_allclose(found.normals[found.index[4:]], np.tile([0, 0, 1], (4, 1)), atol=1e-12)
    touching = replace(mesh, corners=np.array([0, 1, 2, 3, 2, 1, 4, 7], np.int32))
    found = corner_normals(touching)
    assert (found.normals[found.index[6:], 2] == 1).all()  # no polygon beside is turned


@pytest.mark.parametrize("kind", ["plain", "smoothing groups", "normals of the file", "turned"])
def test_normals_are_the_same_whatever_the_blocks(monkeypatch, kind):
    """A rough grid of triangles and quads, some doubled so that they cancel, some without area."""
    random = np.random.default_rng(3)
    x, y = (part.ravel() for part in np.meshgrid(np.arange(9.0), np.arange(9.0)))
    vertices = np.stack([x, y, random.normal(size=81) * 0.4], axis=1)
    first = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = [[a, a + 1, a + 10, a + 9][: 3 + a % 2] for a in first]
    faces += [faces[5][::-1], [3, 3, 4], [0, 1, 2, 12, 11, 10]]
    mesh = Mesh(
        vertices,
        np.concatenate(faces).astype(np.int32),
        np.cumsum([0, *map(len, faces)]).astype(np.int32),
    )
    turned = None
    if kind == "smoothing groups":
        mesh = replace(mesh, polygon_smoothing=random.integers(-1, 3, len(faces)).astype(np.int32))
    elif kind == "normals of the file":
        normals = np.concatenate([random.normal(size=(20, 3)), np.zeros((1, 3))])
        rows = random.integers(-1, 21, len(mesh.corners)).astype(np.int32)
        mesh = replace(mesh, normals=normals, corner_normals=rows)
    elif kind == "turned":
        turned = random.random(len(faces)) < 0.3

    def results():
        yield reversed_polygons(mesh)
        for weights, crease, method in product(("angle", "area", "equal"), (None, 0.0, 30.0, 180.0), METHODS):
            made = corner_normals(mesh, weights, crease, turned is None, method, turned)
            yield from (made.normals, made.index, dict(made.repairs))

    whole = list(results())
    monkeypatch.setattr(polygon_normals_module, "BLOCK", 7)
    for one, other in zip(whole, results(), strict=True):
        np.testing.assert_array_equal(one, other)
