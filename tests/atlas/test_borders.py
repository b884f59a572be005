"""Texels along the borders of charts."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.atlas.borders import border_edges, border_texels
from illumcli.atlas.centres import covered_centres
from illumcli.atlas.texels import INSET, texels_of
from illumcli.atlas.triangles import TextureSize, atlas_triangles

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


def triangles_of(uvs, corners, width=32, height=32):
    corners = np.array(corners, np.int32).reshape(-1, 3)
    size = TextureSize(width, height)
    return atlas_triangles(size, np.array(uvs, float), corners, np.arange(len(corners), dtype=np.int32))


def border_of(triangles):
    is_covered = np.zeros(triangles.size.texels, bool)
    is_covered[covered_centres(triangles).texel] = True
    return border_texels(triangles, is_covered), is_covered


def test_edges_between_two_triangles_are_no_border():
    number, edge = border_edges(triangles_of(0.25 + SQUARE / 2, [[0, 1, 2], [0, 2, 3]]))
    assert sorted(zip(number.tolist(), edge.tolist(), strict=True)) == [(0, 0), (0, 1), (1, 1), (1, 2)]


def test_equal_uv_count_as_one_edge_whatever_their_rows():
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    twice = (0.25 + SQUARE / 2)[corners.ravel()]
    assert len(border_edges(triangles_of(twice, np.arange(6)))[0]) == 4


def test_charts_on_top_of_each_other_keep_their_border():
    corners = [[0, 1, 2], [0, 2, 3]]
    twice = [*corners, *corners, *np.flip(corners, axis=1)]
    assert len(border_edges(triangles_of(0.25 + SQUARE / 2, twice))[0]) == 12


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 40), st.integers(3, 40))
def test_lookups_on_the_surface_read_no_other_texel(seed, width, height):
    random = np.random.default_rng(seed)
    uvs = random.uniform(-0.3, 1.2, (1, 2)) + random.normal(size=(6, 2)) * random.choice([0.01, 0.1, 0.5])
    triangles = triangles_of(uvs, [[0, 1, 2], [3, 4, 5]], width, height)
    border, is_covered = border_of(triangles)
    known = is_covered.copy()
    known[border.texel] = True
    assert not is_covered[border.texel].any()

    # bilinear lookups at random places of the triangles
    for k in range(len(triangles.triangle)):
        share = random.dirichlet([0.5] * 3, 300)
        x, y = share @ triangles.x[:, k] - 0.5, share @ triangles.y[:, k] - 0.5
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column, row = np.floor(x + 1e-9).astype(int) + dx, np.floor(y + 1e-9).astype(int) + dy
            counts = (np.abs(column - x) < 1 - 1e-6) & (np.abs(row - y) < 1 - 1e-6)
            assert known[triangles.size.texel(column, row)][counts].all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_border_texels_have_the_nearest_place(seed):
    random = np.random.default_rng(seed)
    uvs = random.uniform(0.2, 0.8, (6, 2))
    triangles = triangles_of(uvs, np.arange(6), 24, 24)
    border, _ = border_of(triangles)
    share = random.dirichlet([0.5] * 3, 4000)
    x = np.concatenate([share @ triangles.x[:, k] for k in range(len(triangles.triangle))])
    y = np.concatenate([share @ triangles.y[:, k] for k in range(len(triangles.triangle))])
    for k in range(0, len(border.texel), 7):
        number, first = border.number[k], int(border.edge[k])
        ends = [(axis[first, number], axis[(first + 1) % 3, number]) for axis in (triangles.x, triangles.y)]
        place = [a + border.along[k] * (b - a) for a, b in ends]
        distance = np.hypot(place[0] - border.x[k], place[1] - border.y[k])
        away = np.abs([x - border.x[k], y - border.y[k]])
        assert distance <= np.hypot(*away[:, away.max(axis=0) < 1]).min(initial=2**0.5) + 1e-4


def test_a_chart_smaller_than_a_texel_has_texels():
    texels = texels_of(triangles_of(0.5 + SQUARE[:3] / 1000, [0, 1, 2])).places
    assert len(texels.texel) == len(set(texels.texel.tolist())) == 4


def test_places_are_inside_their_triangles():
    triangles = triangles_of(0.25 + SQUARE / 2, [[0, 1, 2], [0, 2, 3]])
    texels = texels_of(triangles).places
    border = ~np.isin(texels.texel, covered_centres(triangles).texel)
    least = np.minimum.reduce([texels.u, texels.v, 1 - texels.u - texels.v])
    assert least[border].min() > 0
    # the height of the triangles over their legs is 16 texels
    assert least[border].max() < INSET / 5
