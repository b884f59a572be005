"""Reconstruction of w at points: noise goes, edges and what is open stay, coarse meshes keep raw values."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.baking.points import Points
from illumcli.baking.reconstruction import RawValues, reconstruct, rotated_cells
from illumcli.geometry.scene_geometry import SceneGeometry


def plane(count, seed=0):
    """Points of a square with its normal."""
    position = np.random.default_rng(seed).random((count, 3)) * [1, 0, 1]
    n = np.repeat([[0.0, 1.0, 0.0]], count, axis=0)
    return points_at(position, n)


def points_at(position, n, objects=None):
    count = len(position)
    return Points(
        geometry=SceneGeometry.__new__(SceneGeometry),
        n=np.asfortranarray(n, np.float32),
        position=np.asfortranarray(position, np.float32),
        key=np.arange(count, dtype=np.uint32),
        objects=np.zeros(count, np.int32) if objects is None else objects,
        is_flat=np.ones(count, bool),
    )


def sphere(count):
    n = np.random.default_rng(3).normal(size=(count, 3))
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def noisy(hidden, sigma, seed=1):
    noise = np.random.default_rng(seed).normal(0, sigma, len(hidden))
    return RawValues(hidden + noise, np.full(len(hidden), sigma**2))


def reconstructed(points, raw, threads=1):
    return reconstruct(points, rotated_cells(points, threads), raw, threads)


def rmse(a, b):
    return np.sqrt(np.mean(np.square(a - b)))


def test_a_linear_surface_loses_its_noise():
    points = plane(4000)
    truth = 0.3 + 0.2 * points.position[:, 0].astype(float)
    values = reconstructed(points, noisy(truth, 0.05))
    assert rmse(values.hidden, truth) < 0.05 / 4
    assert 0.3 < rmse(values.hidden, truth) / np.sqrt(values.risk.mean()) < 1.1
    assert values.windows[128] > 0.7


class DensePoints(Points):
    is_dense = True


def test_noise_beyond_what_is_stated_goes_where_points_are_dense():
    sparse = plane(4000)
    dense = DensePoints(**vars(sparse))
    truth = 0.3 + 0.2 * sparse.position[:, 0].astype(float)
    raw = noisy(truth, 0.1)
    understated = RawValues(raw.hidden, raw.variance / 10)
    assert reconstructed(sparse, understated).windows[1] > 0.9
    values = reconstructed(dense, understated)
    assert values.windows[1] == 0
    assert rmse(values.hidden, truth) < 0.1 / 4


def test_w_that_bends_from_point_to_point_keeps_its_raw_values():
    points = plane(300)
    truth = np.random.default_rng(5).random(300)
    raw = noisy(truth, 0.01)
    values = reconstructed(points, raw)
    assert values.windows[1] > 0.95
    assert rmse(values.hidden, truth) < 0.0115


@pytest.mark.parametrize(("roughness", "raw"), [(0.05, False), (0.2, True)])
def test_the_choice_weighs_bias_against_noise(roughness, raw):
    points = plane(4000)
    truth = np.random.default_rng(5).normal(0.5, roughness, 4000)
    values = reconstructed(points, noisy(truth, 0.1))
    assert (values.windows[1] > 0.9) == raw
    assert (values.windows[1] < 0.1) == (not raw)


def test_a_step_over_a_hard_edge_stays():
    step = np.concatenate([plane(1000).position, plane(1000, 7).position[:, [1, 0, 2]]])
    n = np.repeat([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], 1000, axis=0)
    truth = np.repeat([0.2, 0.8], 1000)
    values = reconstructed(points_at(step, n), noisy(truth, 0.05))
    assert np.abs(values.hidden - truth).max() < 0.06
    assert values.windows[128] > 0.7


def test_bent_normals_lose_their_noise_too():
    points = plane(4000)
    x = points.position[:, 0].astype(float)
    truth = np.stack([0.4 * x, np.sqrt(1 - 0.16 * x**2), 0 * x], axis=1)
    raw = noisy(0.3 + 0.1 * x, 0.05)
    bent = truth + np.random.default_rng(2).normal(0, 0.1, truth.shape)
    values = reconstructed(points, RawValues(raw.hidden, raw.variance, bent))
    np.testing.assert_allclose(np.linalg.norm(values.bent, axis=1), 1, rtol=1e-6)
    assert rmse(values.bent, truth) < 0.1 / 4
    assert values.hidden.tobytes() == reconstructed(points, raw).hidden.tobytes()


def test_bent_normals_of_raw_values_stay_raw():
    points = plane(300)
    bent = sphere(300)
    raw = noisy(np.random.default_rng(5).random(300), 0.001)
    values = reconstructed(points, RawValues(raw.hidden, raw.variance, bent))
    assert values.windows[1] == 1
    np.testing.assert_allclose(values.bent, bent, atol=1e-6)


def test_what_saw_nothing_hidden_stays_open_exactly():
    points = plane(2000)
    hidden = np.where(points.position[:, 0] > 0.8, 0.4, 0.0)
    values = reconstructed(points, RawValues(hidden, np.full(2000, 1e-3)))
    assert (values.hidden[points.position[:, 0] < 0.4] == 0).all()
    assert (values.hidden[hidden > 0] > 0).all()


def test_no_value_crosses_to_another_object():
    position = plane(2000).position
    objects = np.random.default_rng(0).integers(0, 2, 2000).astype(np.int32)
    truth = np.where(objects == 0, 0.0, 0.6)
    n = np.repeat([[0.0, 1.0, 0.0]], 2000, axis=0)
    values = reconstructed(points_at(position, n, objects), RawValues(truth, np.full(2000, 1e-2)))
    np.testing.assert_allclose(values.hidden, truth, atol=1e-6)


@pytest.mark.parametrize("count", [0, 1, 7, 9, 5000])
def test_threads_change_nothing_and_few_points_are_no_fault(count):
    points = plane(count)
    raw = noisy(np.full(count, 0.3), 0.1)
    one, three = (reconstructed(points, raw, threads) for threads in (1, 3))
    assert np.isfinite(one.hidden).all()
    assert one.hidden.tobytes() == three.hidden.tobytes()
    assert one.risk.tobytes() == three.risk.tobytes()


def test_values_of_each_point_come_from_the_cells_around():
    points = plane(4000)
    raw = noisy(np.full(4000, 0.5), 0.05)
    before = reconstructed(points, raw).hidden
    far = points.position[:, 0] > 0.9
    changed = RawValues(np.where(far, 0.1, raw.hidden), raw.variance)
    after = reconstructed(points, changed).hidden
    near = points.position[:, 0] < 0.3
    assert (before[near] == after[near]).all()
    assert len(rotated_cells(points, 1)[0].points) == 500
