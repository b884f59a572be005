"""Pixels that need more than one sample, on small planes of values."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.film.adaptive import around, bend, refined
from illumcli.film.tiles import Tile
from illumcli.film.view import Adaptive, View
from illumcli.rays.camera import footprint
from illumcli.rays.interaction import Hits
from illumcli.scene.spec import Filter

SHAPE = (5, 12)
NONE = np.zeros(SHAPE[0] * SHAPE[1], bool)


def wanted(plane, difference=0.02, reach=1, spread=1.0, seen=None):
    """(5, 12) pixels of a layer with these values that are refined because of the values alone."""
    view = View("main", None, SHAPE[1], SHAPE[0], 1, Adaptive(2, reach, spread), 16)
    sample = np.arange(plane.size, dtype=np.int32) if seen is None else np.flatnonzero(seen).astype(np.int32)
    hits = Hits(sample, sample, sample, sample.astype(np.float32), sample.astype(np.float32))
    values = np.asarray(plane, np.float32).ravel()[sample]
    tile = Tile(0, 0, SHAPE[1], SHAPE[0])
    return refined(difference, view, tile, hits, NONE, values).reshape(SHAPE)


def columns(mask):
    """The columns that are refined; all rows alike."""
    assert (mask == mask[0]).all()
    return np.flatnonzero(mask[0]).tolist()


def test_a_slope_is_enough_known_by_its_centres():
    y, x = np.indices(SHAPE)
    assert not wanted(0.05 * x + 0.08 * y).any()


@pytest.mark.parametrize(("reach", "expected"), [(1, [4, 5, 6, 7]), (2, [3, 4, 5, 6, 7, 8])])
def test_a_step_wants_samples_as_far_as_the_filter_reaches(reach, expected):
    x = np.indices(SHAPE)[1]
    assert columns(wanted(1.0 * (x > 5), reach=reach)) == expected


def test_differences_are_weighed_by_what_is_around_and_by_the_filter():
    x = np.indices(SHAPE)[1]
    assert not wanted(0.5 + 0.009 * (x > 5)).any()
    assert wanted(0.5 + 0.011 * (x > 5)).any()
    assert wanted(0.5 + 0.009 * (x > 5), spread=2.0).any()
    assert not wanted(0.0009 * (x > 5)).any()  # dark
    assert wanted(0.0011 * (x > 5)).any()


def test_what_sees_nothing_is_black():
    seen = np.indices(SHAPE)[1] > 5
    assert columns(wanted(np.ones(SHAPE), seen=seen)) == [4, 5, 6, 7]


def test_extremes_and_bends_of_a_plane():
    random = np.random.default_rng(1)
    plane = random.random(SHAPE)
    padded = np.pad(plane, 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))
    np.testing.assert_array_equal(around(plane, np.maximum, 2), windows.max(axis=(2, 3)))
    np.testing.assert_array_equal(around(plane, np.minimum, 2), windows.min(axis=(2, 3)))
    bends = bend(plane)
    y, x = 2, 7
    across = abs(plane[y, x - 1] - 2 * plane[y, x] + plane[y, x + 1])
    down = abs(plane[y - 1, x] - 2 * plane[y, x] + plane[y + 1, x])
    assert bends[y, x] == pytest.approx(max(across, down), rel=1e-12)
    assert bends[0, 0] == bends[-1, -1] == 0


def test_beyond_the_film_a_plane_goes_on_straight():
    plane = np.tile(np.arange(12.0), (5, 1))
    assert around(plane, np.minimum, 1, straight=True)[2].tolist() == [-1, *range(11)]
    assert around(plane, np.maximum, 1, straight=True)[2].tolist() == [*range(1, 12), 12]


@pytest.mark.parametrize("kind", ["box", "tent", "gaussian"])
@pytest.mark.parametrize("width", [1.0, 2.0, 5.0])
def test_footprints_are_those_of_the_filters_samples(kind, width):
    from illumcli.rays.camera import offsets

    points = (np.arange(1 << 16) + 0.5) / (1 << 16)
    film_filter = Filter(filter=kind, width=width)
    golden = (np.arange(1 << 16) * 0.6180339887498949) % 1
    x, y = offsets(points, golden, film_filter)
    reach, spread = footprint(film_filter)
    for axis in (x, y):
        assert np.quantile(np.abs(axis), 0.99) <= max(reach, 0.5)
        assert np.var(axis) * 12 == pytest.approx(spread, rel=0.02)
