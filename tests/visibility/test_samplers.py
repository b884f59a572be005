"""Properties of every row of `SAMPLERS`: unit directions, cosine-weighted, the same for the same draws."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.visibility.samplers import SAMPLERS


@pytest.fixture(params=SAMPLERS)
def sampler(request):
    return SAMPLERS[request.param]


def test_directions_are_unit_and_above_the_plane(sampler):
    draws = np.random.default_rng(1).random((2, 200))
    d = sampler.directions(draws, 64)
    assert (d.shape, d.dtype) == ((200, 3, 64), np.float32)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, rtol=1e-5)
    assert (d[:, 2] >= 0).all()
    np.testing.assert_array_equal(d, sampler.directions(draws, 64))


def test_heights_are_cosine_weighted(sampler):
    """Of cos^2, uniform in 0..1, the mean over all points is within 5 standard errors of 1/2."""
    square = np.square(sampler.directions(np.random.default_rng(2).random((2, 4000)), 16)[:, 2])
    means = square.mean(axis=1, dtype=np.float64)
    assert abs(means.mean() - 0.5) <= 5 * max(means.std() / 4000**0.5, 1e-6)


def test_nothing_that_varies_has_no_variation_and_bounds_hold(sampler):
    assert sampler.variation(np.ones((3, 64), bool)).tolist() == [0, 0, 0]
    assert (sampler.variation(np.random.default_rng(3).random((3, 64)) < 0.5) > 0).all()
    cosine = np.float32([1, 0.9, 0.5, 0])
    normal = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)
    d = sampler.directions(np.random.default_rng(4).random((2, 4)), 64)
    below = np.einsum("mk,mki->mi", normal, d) < 0
    first = np.where(below.any(axis=1), below.argmax(axis=1), 64)
    assert (64 - first <= sampler.max_below(cosine, 64)).all()


def test_marks_differ():
    assert len({sampler.mark for sampler in SAMPLERS.values()}) == len(SAMPLERS)
