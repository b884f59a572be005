"""Weights of polygon corners: properties of generalised barycentric coordinates, for any triangulation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.arrays import column_major
from illumcli.geometry import planar
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.planar import planar_polygons
from illumcli.geometry.scene_geometry import CornerVectors, place_meshes, polygon_centres
from illumcli.geometry.transforms import rotation
from illumcli.rays.corner_weights import (
    CornerWeights,
    MeanCorners,
    TriangleCorners,
    concatenated,
    corner_weights,
)
from illumcli.rays.interaction import ShadingContext, SurfaceInteraction, quadratic

F = np.float32
TURNED = rotation(0, 33) @ rotation(1, 12) @ rotation(2, 71)
MIRRORED = TURNED @ np.diag([-1.0, 1.0, 1.0, 1.0])
L_SHAPE = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]
ARROW = [[0, 0], [1, 0.4], [2, 0], [1, 1]]  # a concave quad
KEYHOLE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]
STAR = [
    [r * np.cos(a), r * np.sin(a)]
    for r, a in zip([1, 0.4] * 5, np.arange(10) * np.pi / 5, strict=True)
]  # fmt: skip
POLE = [[0, 0], [1, 0], [0.5, 1], [0.5, 1]]
STRAIGHT = [[0, 0], [1, 0], [2, 0], [1, 1]]
NAMED = {
    "L": L_SHAPE,
    "arrow": ARROW,
    "keyhole": KEYHOLE,
    "star": STAR,
    "pole": POLE,
    "straight": STRAIGHT,
}


def weights_at(geometry, planar, triangle, u, v):
    return corner_weights(geometry, TriangleCorners(None, geometry.objects[triangle], triangle, u, v), planar)


def ring(radii, squeeze=1.0):
    angles = np.arange(len(radii)) * 2 * np.pi / len(radii)
    return np.stack([radii * np.cos(angles), squeeze * radii * np.sin(angles)], axis=1)


def polygon(points):
    """A mesh of one polygon in the plane z = 0."""
    points = np.asarray(points, float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return Mesh(points, np.arange(len(points), dtype=np.int32), np.array([0, len(points)], np.int32))


def anywhere(geometry, count=400, seed=3):
    random = np.random.default_rng(seed)
    triangle = random.integers(0, len(geometry.triangles), count).astype(np.int32)
    a, b = np.sort(random.random((2, count)), axis=0)
    return triangle, a.astype(F), (b - a).astype(F)


def positions(geometry, triangle, u, v):
    a, b, c = (geometry.vertices[geometry.triangles[triangle, k]].astype(float) for k in range(3))
    u, v = u.astype(float)[:, None], v.astype(float)[:, None]
    return (1 - u - v) * a + u * b + v * c


def dense(weights, geometry):
    """(M, C) weights of all the scene's corners."""
    corners = CornerVectors(
        np.eye(geometry.corners.max() + 1, dtype=F), np.arange(geometry.corners.max() + 1)
    )
    return weights.interpolate(geometry, corners)


def at(points, seed=3, matrix=TURNED):
    geometry = place_meshes([polygon(points)], [matrix])
    found = planar_polygons(geometry)
    assert found is not None
    hits = anywhere(geometry, seed=seed)
    return geometry, hits, weights_at(geometry, found, *hits)


convex = st.builds(
    lambda count, seed, squeeze: (
        ring(np.ones(count), squeeze)
        if seed is None
        else np.stack([np.cos(a := spread(count, seed)), squeeze * np.sin(a)], axis=1)
    ),
    st.integers(4, 20),
    st.none() | st.integers(0, 10_000),
    st.floats(0.05, 1),
)


def spread(count, seed):
    """Angles round a circle, none of the gaps more than half a turn."""
    return np.sort((np.arange(count) + np.random.default_rng(seed).random(count) * 0.9) * 2 * np.pi / count)


stars = st.builds(
    lambda count, seed: ring(np.random.default_rng(seed).uniform(0.2, 1, count)),
    st.integers(4, 20),
    st.integers(0, 10_000),
)


@given(points=convex | stars, mirrored=st.booleans())
@settings(max_examples=60, deadline=None)
def test_weights_sum_to_one_and_linear_functions_come_back(points, mirrored):
    geometry, hits, weights = at(points, matrix=MIRRORED if mirrored else TURNED)
    own = weights.groups[0]
    np.testing.assert_allclose(sum(own.weight(k) for k in range(own.count)), 1, atol=3e-7)
    np.testing.assert_allclose(
        weights.interpolate_vertices(geometry, geometry.vertices), positions(geometry, *hits), atol=4e-7
    )


@given(points=convex)
@settings(max_examples=60, deadline=None)
def test_no_weight_is_negative_in_a_convex_polygon(points):
    geometry, _, weights = at(points)
    assert dense(weights, geometry).min() >= -1e-6  # a hit lies across an edge by the rounding of u, v


@pytest.mark.parametrize("name", NAMED)
def test_the_named_polygons_are_interpolated_with_linear_precision(name):
    geometry, hits, weights = at(NAMED[name])
    np.testing.assert_allclose(
        weights.interpolate_vertices(geometry, geometry.vertices), positions(geometry, *hits), atol=4e-7
    )


@given(points=convex | stars | st.sampled_from(list(NAMED.values())), seed=st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_values_stay_within_the_range_of_the_corners(points, seed):
    geometry, _, weights = at(points)
    values = np.random.default_rng(seed).uniform(-1, 1, (len(geometry.vertices), 2)).astype(F)
    found = weights.interpolate_vertices(geometry, values)
    assert (found >= values.min(axis=0) - 1e-6).all()
    assert (found <= values.max(axis=0) + 1e-6).all()


@given(points=convex | stars | st.sampled_from([L_SHAPE, ARROW, STAR, STRAIGHT]), seed=st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_values_are_linear_along_edges(points, seed):
    geometry = place_meshes([polygon(points)], [TURNED])
    found = planar_polygons(geometry)
    count = len(geometry.vertices)
    values = np.random.default_rng(seed).uniform(-1, 1, (count, 1)).astype(F)
    share = np.linspace(0, 1, 17).astype(F)
    for triangle in range(len(geometry.triangles)):
        for k in range(3):
            a, b = (int(geometry.corners[triangle, (k + step) % 3]) for step in (0, 1))
            if (b - a) % count not in (1, count - 1):
                continue  # a diagonal
            w = np.zeros((3, len(share)), F)
            w[k], w[(k + 1) % 3] = 1 - share, share
            which = np.full(len(share), triangle, np.int32)
            along = weights_at(geometry, found, which, w[1], w[2]).interpolate_vertices(geometry, values)
            wanted = (1 - share) * values[a] + share * values[b]
            np.testing.assert_allclose(along[:, 0], wanted, atol=2e-6)


@given(points=convex | stars | st.sampled_from([L_SHAPE, ARROW, STAR]), turn=st.integers(1, 19))
@settings(max_examples=60, deadline=None)
def test_another_cut_gives_the_same_values(points, turn):
    """The polygon begins at another corner: fans and ears differ, values at a point do not."""
    points = np.asarray(points, float)
    values = np.random.default_rng(turn).uniform(-1, 1, (len(points), 1)).astype(F)
    worlds = [place_meshes([polygon(np.roll(points, shift, axis=0))], [TURNED]) for shift in (0, turn)]
    triangle, u, v = anywhere(worlds[0])
    where = positions(worlds[0], triangle, u, v)
    other = np.full(len(where), -1, np.int32)
    u2, v2 = np.zeros_like(u), np.zeros_like(v)
    for number, vertices in enumerate(worlds[1].triangles):
        a, b, c = worlds[1].vertices[vertices].astype(float)
        if np.linalg.norm(np.cross(b - a, c - a)) < 1e-12:
            continue
        own = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), (where - a).T, rcond=None)[0]
        inside = (own >= -1e-6).all(axis=0) & (own.sum(axis=0) <= 1 + 1e-6) & (other < 0)
        other[inside], u2[inside], v2[inside] = number, own[0, inside], own[1, inside]
    kept = other >= 0
    assert kept.mean() > 0.9
    one = weights_at(worlds[0], planar_polygons(worlds[0]), triangle, u, v)
    two = weights_at(worlds[1], planar_polygons(worlds[1]), other[kept], u2[kept], v2[kept])
    found = two.interpolate_vertices(worlds[1], np.roll(values, turn, axis=0))
    np.testing.assert_allclose(found, one.interpolate_vertices(worlds[0], values)[kept], atol=3e-5)


@pytest.mark.parametrize("skew", [0.0, 1e-14, 1e-9, 1e-3, 0.3, -0.3])
def test_parallelograms_and_trapezoids_have_exact_bilinear_coordinates(skew):
    corners = np.array([[0, 0], [1, 0], [1.2 + skew, 1], [0.2 - skew, 1 + skew / 2]])
    geometry = place_meshes([polygon(corners)], [np.eye(4)])
    triangle, u, v = anywhere(geometry)
    found = dense(weights_at(geometry, planar_polygons(geometry), triangle, u, v), geometry).astype(float)
    s, t = found[:, 1] + found[:, 2], found[:, 2] + found[:, 3]
    wanted = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
    np.testing.assert_allclose(found, wanted, atol=3e-7)
    np.testing.assert_allclose(found @ geometry.vertices, positions(geometry, triangle, u, v), atol=3e-7)


def two_quads():
    """A flat quad and a folded one that share an edge."""
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.3], [2, 1, -0.3]]
    return Mesh(
        np.array(vertices, float),
        np.array([0, 1, 2, 3, 1, 4, 5, 2], np.int32),
        np.array([0, 4, 8], np.int32),
    )


def test_a_folded_quad_is_interpolated_by_triangles_and_agrees_at_its_edge():
    geometry = place_meshes([two_quads()], [np.eye(4)])
    found = planar_polygons(geometry)
    assert (found.row >= 0).tolist() == [True, True, False, False]
    values = np.random.default_rng(5).random((6, 1)).astype(F)
    share = np.linspace(0, 1, 9).astype(F)
    seen = {0: 0, 1: 0}
    for triangle, vertices in enumerate(geometry.triangles):
        where = [list(vertices).index(v) for v in (1, 2) if v in vertices]
        if len(where) < 2:
            continue
        w = np.zeros((3, len(share)), F)
        w[where[0]], w[where[1]] = 1 - share, share
        which = np.full(len(share), triangle, np.int32)
        along = weights_at(geometry, found, which, w[1], w[2]).interpolate_vertices(geometry, values)
        np.testing.assert_allclose(along[:, 0], (1 - share) * values[1] + share * values[2], atol=1e-6)
        seen[int(geometry.polygons[triangle])] += 1
    assert all(seen.values())


@pytest.mark.parametrize(("fold", "is_flat"), [(2.0**-8 * 0.99, True), (2.0**-8 * 1.01, False)])
def test_a_square_counts_as_flat_up_to_a_fold_of_2_to_the_minus_8(fold, is_flat):
    rise = np.tan(fold / 2) / np.sqrt(2)
    square = polygon([[0, 0, rise], [1, 0, 0], [1, 1, rise], [0, 1, 0]])
    assert (planar_polygons(place_meshes([square], [np.eye(4)])) is not None) == is_flat


def test_what_crosses_itself_or_has_too_many_corners_or_three_is_left_to_triangles():
    bow = polygon([[0, 0], [1, 1], [1, 0], [0, 1]])
    large = polygon(ring(np.ones(planar.MAX_CORNERS + 1)))
    three = polygon([[0, 0], [1, 0], [0, 1]])
    for mesh in (bow, large, three):
        assert planar_polygons(place_meshes([mesh], [np.eye(4)])) is None


def test_polygons_that_are_flat_by_their_normals_are_left_out_where_nothing_else_is_asked():
    geometry = place_meshes([polygon(L_SHAPE), polygon(ARROW)], [np.eye(4)] * 2)
    up, lean = [0, 0, 1], [0.6, 0, 0.8]
    index = np.zeros(10, np.int32)
    index[8] = 1
    found = planar_polygons(geometry, CornerVectors(column_major([up, lean], F), index))
    assert (found.row >= 0).tolist() == [False] * 4 + [True] * 2
    assert planar_polygons(geometry, CornerVectors(column_major([up, lean], F), index * 0)) is None
    assert planar_polygons(geometry, CornerVectors(-column_major([up, lean], F), index * 0)) is None
    leaning = planar_polygons(geometry, CornerVectors(column_major([up, lean], F), index * 0 + 1))
    assert (leaning.row >= 0).all()


def test_triangles_keep_their_bits_beside_polygons():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1]], float)
    mesh = Mesh(vertices, np.array([0, 1, 2, 3, 1, 4, 2], np.int32), np.array([0, 4, 7], np.int32))
    geometry = place_meshes([mesh], [TURNED])
    hits = anywhere(geometry)
    whole = weights_at(geometry, planar_polygons(geometry), *hits).interpolate_vertices(
        geometry, geometry.vertices
    )
    by_triangles = weights_at(geometry, None, *hits).interpolate_vertices(geometry, geometry.vertices)
    alone = geometry.polygons[hits[0]] == 1
    assert alone.any()
    np.testing.assert_array_equal(whole[alone], by_triangles[alone])


def test_some_of_the_hits_and_hits_put_together_keep_their_weights():
    meshes = [polygon(L_SHAPE), two_quads(), polygon(ARROW), polygon(ring(np.ones(9)))]
    geometry = place_meshes(meshes, [np.eye(4)] * 4)
    hits = anywhere(geometry, 1000)
    whole = weights_at(geometry, planar_polygons(geometry), *hits)
    values = np.random.default_rng(1).random((len(geometry.vertices), 3)).astype(F)
    all_of_them = whole.interpolate_vertices(geometry, values)
    half = [np.flatnonzero(hits[0] % 2 == rest) for rest in (0, 1)]
    parts = [whole.take(hits) for hits in half]
    for hits, part in zip(half, parts, strict=True):
        np.testing.assert_array_equal(part.interpolate_vertices(geometry, values), all_of_them[hits])
    joined = concatenated(parts).interpolate_vertices(geometry, values)
    np.testing.assert_array_equal(joined, all_of_them[np.concatenate(half)])
    nothing = whole.take(half[0][:0])
    assert nothing.interpolate_vertices(geometry, values).shape == (0, 3)


def test_the_mean_of_polygons_of_any_size():
    geometry = place_meshes([polygon(L_SHAPE), two_quads()], [np.eye(4)] * 2)
    centres = polygon_centres(geometry)
    group = MeanCorners(None, np.zeros(4, np.int32), centres, np.array([0, 2, 1, 0], np.int32))
    weights = CornerWeights(weights_at(geometry, None, *anywhere(geometry, 4)).hits, (group,))
    found = weights.interpolate_vertices(geometry, geometry.vertices)
    np.testing.assert_allclose(found, centres.position[[0, 2, 1, 0]], atol=1e-6)


def test_quadratic_normals_of_a_strip_are_those_of_its_edges_all_the_way_across():
    """A rectangle whose normals agree and lean along two of its edges: as if these were swept across."""
    width = np.linspace(0, 1, 21).astype(F)
    lean = np.array([0.6, 0, 0.8])
    mesh = Mesh(
        np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float),
        np.arange(4, dtype=np.int32),
        np.array([0, 4], np.int32),
    )
    geometry = place_meshes([mesh], [np.eye(4)])
    for t in (0.0, 0.3, 1.0):
        at = np.stack([2 * width - 1, np.full_like(width, t - 0.5)], axis=1) / geometry.render_space.radius
        a, b, c = (geometry.vertices[geometry.triangles[0, k], :2].astype(float) for k in range(3))
        u, v = np.linalg.solve(np.stack([b - a, c - a], axis=1), (at - a).T)  # beyond the triangle too
        first = np.zeros(len(width), np.int32)
        weights = weights_at(geometry, planar_polygons(geometry), first, u.astype(F), v.astype(F))
        normals = CornerVectors(column_major(lean[None], F), np.zeros(4, np.int32))
        interact = SurfaceInteraction(
            at, column_major(np.tile([0, 0, 1], (21, 1)), F), np.ones(21, F), np.zeros(21, np.bool_)
        )
        bent = lean - (width * (1 - width) * 3 * 1.2)[:, None] * [1, 0, 0]
        wanted = bent / np.linalg.norm(bent, axis=1)[:, None]
        context = ShadingContext(geometry, weights, interact, normals)
        np.testing.assert_allclose(quadratic(context), wanted, atol=2e-6)
