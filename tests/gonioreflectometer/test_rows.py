"""Measured surfaces against closed forms, each within its own standard errors."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import dot, mirror
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.directions import (
    LEAST_COSINE,
    AngleGrid,
    around_half_vector,
    half_angles,
)
from illumcli.gonioreflectometer.mirrors import Ring, above_horizon
from illumcli.gonioreflectometer.mirrors_again import of_cells
from illumcli.gonioreflectometer.rows import Instrument
from illumcli.gonioreflectometer.settings import MeasureSettings, SurfaceSource
from illumcli.gonioreflectometer.sources import read_surface
from illumcli.measured_files.merl import cell_directions
from illumcli.progress import no_progress

SLOPE = np.radians(30.0)
GROOVES = f"abs(mod(x, 1) - 0.5) * {float(np.tan(SLOPE))!r}"


def instrument(formula: str, grid: int = 16, **settings) -> Instrument:
    surface, _ = read_surface(SurfaceSource(formula, grid=grid))
    return Instrument(surface, MeasureSettings(**settings))


def test_a_flat_lambertian_surface_is_its_albedo():
    albedo = np.array([1, 0.5, 0.2])
    row = instrument("0*x", facets="lambert", albedo=tuple(albedo), samples=8).row(40, 2, no_progress)
    measured = np.isfinite(row.values[0])
    l, v = cell_directions(40)
    np.testing.assert_array_equal(measured, (l[:, 2] > LEAST_COSINE) & (v[:, 2] > LEAST_COSINE))
    expected = np.broadcast_to(albedo[:, None] / np.pi, (3, measured.sum()))
    np.testing.assert_allclose(row.values[:, measured], expected, rtol=1e-6)


@pytest.mark.parametrize("turned", [0.0, 1.0])
def test_half_angles_are_those_of_the_table(turned):
    l, v = cell_directions(57)
    theta_h, theta_d, phi_d = half_angles(l, v)
    h = np.array([np.sin(theta_h) * np.cos(turned), np.sin(theta_h) * np.sin(turned), np.cos(theta_h)]).T
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    for ours, theirs in zip(around_half_vector(h, theta_d, phi_d), (l, v), strict=True):
        np.testing.assert_allclose(ours, theirs @ turn, atol=1e-12)


def test_mirror_grooves_are_torrance_and_sparrows():
    """f_r = D G / (4 n.l n.v), G the least of 1, 2 n.h n.v / v.h and 2 n.h n.l / v.h."""
    measured = instrument(GROOVES, samples=32)
    row_number = 51
    row = measured.row(row_number, 2, no_progress)

    # All facets have one slope, so the ring's mean is what it shows there, over the ring's part above.
    edges = (np.arange(row_number, row_number + 2) / 90) ** 2 * (np.pi / 2)
    half_width = max(np.radians(0.5), np.diff(edges)[0] / 2)
    ring = Ring.of(measured.surface, ((row_number + 0.5) / 90) ** 2 * (np.pi / 2), half_width)
    solid_angle = 2 * np.pi * (np.cos(ring.low) - np.cos(ring.high))
    np.testing.assert_allclose(ring.density, 1 / np.cos(SLOPE) / solid_angle)
    theta_d = np.repeat((np.arange(90) + 0.5) * (np.pi / 180), 180)
    phi_d = np.tile((np.arange(180) + 0.5) * (np.pi / 180), 90)
    h = np.broadcast_to([np.sin(SLOPE), 0, np.cos(SLOPE)], (16200, 3))
    l, v = around_half_vector(h, theta_d, phi_d)
    n_l, n_v, v_h = l[:, 2], v[:, 2], np.cos(theta_d)
    masking = np.minimum(1, 2 * np.cos(SLOPE) * np.minimum(n_l, n_v) / v_h)
    part = above_horizon(ring, theta_d, phi_d)
    seen = (n_l > LEAST_COSINE) & (n_v > LEAST_COSINE) & (part > 0)
    expected = ring.density * masking[seen] / (4 * n_l[seen] * n_v[seen]) / part[seen]
    score = (row.values[0, seen] - expected) / row.errors[0, seen]
    assert seen.sum() > 12000
    assert abs(score.mean()) < 4 / seen.sum() ** 0.5
    assert 0.3 < np.sqrt(np.mean(score**2)) < 1.2  # those without masking are exact
    assert np.isnan(row.values[0, part == 0]).all()
    off = row.values[0, seen] / expected - 1
    assert np.median(np.abs(off)) < 0.02


def test_nothing_is_mirrored_where_no_facet_is():
    row = instrument(GROOVES, samples=8).row(40, 1, no_progress)
    assert np.nanmax(row.values) == 0
    assert np.nanmax(row.errors) == 0


def test_lambertian_grooves_lose_nothing():
    """With an albedo of 1 and many bounces, all light leaves again: a grid of eyes adds up to 1."""
    measured = instrument(
        GROOVES, facets="lambert", albedo=(1.0, 1.0, 1.0), bounces=12, isotropic=False, samples=64, step=15.0
    )
    row = measured.row(2, 2, no_progress)
    grid = AngleGrid(15.0)
    first = slice(0, len(grid))
    albedo = row.values[0, first] @ grid.projected
    error = np.sqrt(row.errors[0, first] ** 2 @ grid.projected**2)
    assert abs(albedo - 1) < 4 * error + 0.01  # the grid's own error


def test_mirror_rays_lose_nothing():
    """Bins of all directions hold what rays carry away."""
    measured = instrument(GROOVES, isotropic=False, bounces=8, samples=8, step=15.0)
    row = measured.row(1, 2, no_progress)
    grid = AngleGrid(15.0)
    albedo = row.values[0].reshape(grid.around, len(grid)) @ grid.projected
    np.testing.assert_allclose(albedo, 1, atol=5e-3)  # but for what leaves below 1 degree


def test_what_is_mirrored_twice_is_what_rays_count():
    """The share of light from everywhere that steep grooves mirror more than once."""
    measured = instrument(f"abs(mod(x, 1) - 0.5) * {float(np.tan(np.radians(44)))!r}", samples=8, bounces=4)
    again = of_cells(np.mean([measured.row(90 + k, 1, no_progress).values[0] for k in range(8)], axis=0))
    edges = np.cos((np.arange(91) / 90) ** 2 * (np.pi / 2))
    share = 0.0
    for row in range(90):
        l, v = (np.maximum(d[:, 2], 0).reshape(90, 180) for d in cell_directions(row))
        # d omega_l d omega_v = 4 cos(theta_d) d omega_h d omega_d, over both halves of phi_d
        squares = np.sin(np.arange(91) / 90 * np.pi / 2) ** 2
        measure = 2 * np.diff(squares)[:, None] * (2 * np.pi / 180)
        measure = measure * (2 * np.pi) * (edges[row] - edges[row + 1])
        share += np.sum(again[row] * l * v * measure) / np.pi

    random, count = np.random.default_rng(1), 100_000
    radius, turn = np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    l = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=1)
    l = l[l[:, 2] > LEAST_COSINE]
    bench = Bench(measured.surface)
    hits = bench.first_points(l, random.random((len(l), 2)))
    once = bench.leaving(hits, mirror(l, hits.normal, dot(l, hits.normal)))
    assert abs(share / np.mean(once.is_hit) - 1) < 0.03


def test_the_same_row_for_any_number_of_threads():
    one, two = (
        instrument(GROOVES, facets="lambert", samples=8, bounces=2, albedo=(0.5,) * 3).row(
            70, threads, no_progress
        )
        for threads in (1, 2)
    )
    np.testing.assert_array_equal(one.values, two.values)
    np.testing.assert_array_equal(one.errors, two.errors)


def test_a_target_error_is_reached():
    rough = instrument("0.1*cos(2*pi*x)", facets="lambert", samples=8)
    settings = {**vars(rough.settings), "target_error": 0.08}
    row = Instrument(rough.surface, MeasureSettings(**settings)).row(60, 2, no_progress)
    l, v = cell_directions(60)
    weights, seen = l[:, 2] * v[:, 2], np.isfinite(row.values[0])
    reached = np.linalg.norm((row.errors[0] * weights)[seen]) / np.linalg.norm(
        (row.values[0] * weights)[seen]
    )
    assert row.samples > 8
    assert reached < 0.08
