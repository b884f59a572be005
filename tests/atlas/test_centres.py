"""Texels whose centres triangles cover."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.atlas import centres as module
from illumcli.atlas.centres import covered_centres
from illumcli.atlas.triangles import TextureSize, atlas_triangles


def triangles_of(uvs, corners, width=32, height=32):
    corners = np.array(corners, np.int32).reshape(-1, 3)
    size = TextureSize(width, height)
    return atlas_triangles(size, np.array(uvs, float), corners, np.arange(len(corners), dtype=np.int32))


def grid(count, move=0.0, seed=0):
    """uv of a square of [0, 1]^2 cut into 2 count^2 triangles, inner points moved at random, by less than a
    quarter of a cell in u and v if no triangle shall be turned over."""
    u, v = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1))
    uvs = np.stack([u.ravel(), v.ravel()], axis=1)
    inner = ((uvs > 0) & (uvs < 1)).all(axis=1)
    uvs[inner] += np.random.default_rng(seed).uniform(-move, move, (inner.sum(), 2)) / count
    corner = np.arange(count * (count + 1)).reshape(count, count + 1)[:, :count].ravel()
    lower = np.stack([corner, corner + 1, corner + count + 2], axis=1)
    upper = np.stack([corner, corner + count + 2, corner + count + 1], axis=1)
    return uvs, np.concatenate([lower, upper])


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 9), st.floats(0, 0.24), st.integers(1, 40), st.integers(1, 40), st.integers(0, 9))
def test_triangles_that_share_edges_cover_every_centre_once(count, move, width, height, seed):
    covered = covered_centres(triangles_of(*grid(count, move, seed), width, height))
    assert sorted(covered.texel) == list(range(width * height))


def test_edges_through_centres_belong_to_one_triangle():
    # all edges of the grid run through centres: a texture of odd size, cells of whole texels
    uvs, corners = grid(4)
    uvs = uvs * 12 / 13 + 0.5 / 13
    covered = covered_centres(triangles_of(uvs, corners, 13, 13))
    assert len(covered.texel) == len(set(covered.texel.tolist())) == 144


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_places_are_those_of_the_centres(seed):
    random = np.random.default_rng(seed)
    uvs = random.uniform(-2, 3, (3, 2))
    covered = covered_centres(triangles_of(uvs, [0, 1, 2], 17, 11))
    u, v = covered.u.astype(float), covered.v.astype(float)
    place = np.stack([1 - u - v, u, v], axis=1) @ uvs
    column, row = covered.texel % 17, covered.texel // 17
    # modulo whole tiles, v upwards
    away = place - np.stack([(column + 0.5) / 17, 1 - (row + 0.5) / 11], axis=1)
    away -= np.rint(away)
    assert np.abs(away * [17, 11]).max(initial=0) < 2e-3


def test_number_of_texels_is_the_area():
    random = np.random.default_rng(1)
    triangles = triangles_of(random.random((300, 2)), np.arange(300), 512, 512)
    covered = covered_centres(triangles)
    area = np.abs(triangles.double_area) / 2
    count = np.bincount(covered.number, minlength=100)
    assert (np.abs(count - area) / np.sqrt(area)).mean() < 0.05
    assert count.sum() == pytest.approx(area.sum(), rel=1e-3)


def test_blocks_do_not_change_what_is_covered(monkeypatch):
    triangles = triangles_of(*grid(5, 0.3), 64, 64)
    whole = covered_centres(triangles)
    monkeypatch.setattr(module, "AT_ONCE", 7)
    parts = covered_centres(triangles)
    for name in ("texel", "number", "u", "v"):
        whole_of, parts_of = getattr(whole, name), getattr(parts, name)
        np.testing.assert_array_equal(
            whole_of[np.lexsort((whole.number, whole.texel))],
            parts_of[np.lexsort((parts.number, parts.texel))],
        )


def test_uv_outside_of_the_texture_repeat_it():
    uvs, corners = grid(3, 0.2)
    inside = covered_centres(triangles_of(uvs, corners))
    moved = covered_centres(triangles_of(uvs + np.array([5, -3]), corners))
    np.testing.assert_array_equal(np.sort(inside.texel), np.sort(moved.texel))
    across = covered_centres(triangles_of(uvs + np.array([0.25, -0.5]), corners))
    assert sorted(across.texel) == list(range(32 * 32))


def test_no_triangles_cover_nothing():
    assert not len(covered_centres(triangles_of(np.zeros((0, 2)), [])).texel)


def test_what_has_no_area_or_uv_is_counted_and_left_out():
    triangles = triangles_of(
        [[0, 0], [1, 0], [0, 1], [0.5, 0]], [[0, 1, 2], [0, 3, 1], [0, -1, 2], [2, 1, 0]]
    )
    assert (triangles.without_area, triangles.without_uv) == (1, 1)
    assert triangles.triangle.tolist() == [0, 3]
    assert triangles.is_mirrored.tolist() == [False, True]


def test_tiles_are_counted():
    uvs = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    several = np.concatenate([uvs, uvs + np.array([1, 0]), uvs + np.array([3, 2]), uvs])
    assert triangles_of(several, np.arange(12)).tiles == 3
