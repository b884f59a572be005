"""Point sets: nets remain nets, and numbers depend on their purpose alone."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.rays import sampling


@pytest.mark.parametrize("power", [2, 4, 6, 8])
def test_every_elementary_interval_of_a_scrambled_net_holds_one_point(power):
    count = 1 << power
    points = sampling.pixel_points(5, np.arange(32, dtype=np.uint32), count).reshape(32, count, 2)
    for split in range(power + 1):
        cell = (points[..., 0] * (1 << split)).astype(int) * (1 << (power - split))
        cell += (points[..., 1] * (1 << (power - split))).astype(int)
        assert (np.sort(cell, axis=1) == np.arange(count)).all()


def test_points_of_a_pixel_do_not_depend_on_its_company():
    pixels = np.arange(100, dtype=np.uint32)
    whole = sampling.pixel_points(9, pixels, 7).reshape(100, 7, 2)
    assert np.array_equal(whole[40:43].reshape(-1, 2), sampling.pixel_points(9, pixels[40:43], 7))


def test_seed_and_purpose_both_change_the_key():
    keys = {sampling.stream(seed, purpose) for seed in range(3) for purpose in ("pixel", "obscurance")}
    assert len(keys) == 6


def test_one_point_is_the_centre():
    assert (sampling.pixel_points(3, np.arange(5, dtype=np.uint32), 1) == 0.5).all()


def test_hashed_numbers_are_uniform():
    x = sampling.unit_interval(sampling.hashed(12345, np.arange(1 << 16, dtype=np.uint32)))
    counts = np.histogram(x, bins=64, range=(0, 1))[0]
    chi2 = (np.square(counts - 1024) / 1024).sum()
    assert 25 < chi2 < 120  # 63 degrees of freedom: mean 63, deviation 11


@pytest.mark.parametrize("count", [1, 5, 64, 100])
def test_spiral_directions_are_unit_up_and_cosine_weighted(count):
    table = sampling.spiral_table(count).astype(float)
    assert table.shape == (max(16, 16384 // count), 3, count)
    np.testing.assert_allclose(np.linalg.norm(table, axis=1), 1, atol=1e-6)
    assert (table[:, 2] > 0).all()
    # every ring of the disc, r^2 in [i/N, (i+1)/N), holds one point
    ring = np.floor(np.square(table[:, :2]).sum(axis=1) * count * (1 - 1e-6))
    assert (np.sort(ring, axis=1) == np.arange(count)).all()


def test_dither_spreads_the_samples_of_a_pixel():
    for count in (64, 256, 1024):
        here = np.zeros(count, np.int64)
        turn, phase = sampling.dither(1, here + 5, here + 9, np.arange(count))
        side = int(count**0.5)
        cells = np.unique((turn * side).astype(int) * side + (phase * side).astype(int))
        assert len(cells) > 0.6 * count  # points on a line fill 0.03 of 1024


def test_dither_spreads_over_small_neighbourhoods():
    y, x = np.divmod(np.arange(64 * 64), 64)
    turn, phase = sampling.dither(1, x, y, np.zeros_like(x))
    for draws in (turn, phase):
        block = draws.reshape(64, 64)[10:14, 20:24].ravel()
        gaps = np.diff(np.sort(block), append=np.sort(block)[0] + 1)
        assert gaps.max() < 4 / 16


@pytest.mark.parametrize("samples", [16, 64])
def test_consecutive_spirals_fill_the_disc_together(samples):
    # shares of the disc beyond random chords: 32 spirals in a row are half as far off as independent ones
    rng = np.random.default_rng(2)
    angle, distance = 2 * np.pi * rng.random(300), 2 * rng.random(300) - 1
    share = (np.arccos(distance) - distance * np.sqrt(1 - distance**2)) / np.pi

    def off(draws):
        radius = np.sqrt((np.arange(samples) + draws[1][:, None]) / samples)
        turn = 2 * np.pi * (np.arange(samples) * sampling.GOLDEN + draws[0][:, None])
        along = radius[..., None] * np.cos(turn[..., None] - angle)
        return np.sqrt(np.mean(np.square((along > distance).mean(axis=(0, 1)) - share)))

    number = np.arange(32)
    together = np.mean([off(sampling.spiral_draws(key, number)) for key in range(8)])
    apart = np.mean([off(rng.random((2, 32))) for _ in range(8)])
    assert together < 0.6 * apart


def test_a_shuffle_is_the_stable_order_of_the_hashes():
    number = np.arange(5000, dtype=np.uint32) % 700
    expected = np.argsort(sampling.hashed(9, number), kind="stable")
    assert sampling.shuffled(9, number).tolist() == expected.tolist()
