"""Differences between images, against sums made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from illumcli.film import metrics
from illumcli.film.metrics import difference

A = np.array([[0.0, 1.0], [2.0, 3.0]], np.float32)
B = np.array([[0.0, 1.5], [2.0, 1.0]], np.float32)


def test_hand_computed_image():
    found = difference(A, B)
    assert found.count == 4
    assert found.not_finite == 0
    assert found.mae == pytest.approx(2.5 / 4)
    assert found.mse == pytest.approx((0.25 + 4) / 4)
    assert found.rmse == pytest.approx(math.sqrt(4.25 / 4))
    assert found.relative_mse == pytest.approx((0.25 / 1.01 + 4 / 9.01) / 4)
    assert found.psnr == pytest.approx(10 * math.log10(1 / (4.25 / 4)))
    assert (found.largest, found.place) == (2, (1, 1, 0))


def test_peak_is_one_given_or_the_references_own():
    assert difference(A, B).peak == 1
    assert difference(A, B, peak=255).psnr == pytest.approx(10 * math.log10(255**2 / (4.25 / 4)))
    assert difference(A, B, peak=None).peak == 3
    assert difference(-A, B, peak=None).peak == 3


def test_equal_images_differ_in_nothing():
    found = difference(A, A)
    assert (found.rmse, found.mae, found.relative_mse, found.largest, found.place) == (0, 0, 0, 0, (0, 0, 0))
    assert found.psnr == math.inf


def test_black_reference_has_no_signal():
    assert difference(A * 0, B, peak=None).psnr == -math.inf


def test_values_that_are_not_finite_are_counted_and_left_out():
    a, b = A.copy(), B.copy()
    a[0, 0], b[1, 1] = np.nan, np.inf
    found = difference(a, b, peak=None)
    assert (found.count, found.not_finite) == (2, 2)
    assert found.mae == pytest.approx(0.25)
    assert (found.largest, found.place) == (0.5, (0, 1, 0))
    assert found.peak == 3


def test_equal_infinities_are_equal():
    a = np.array([[np.inf, 1]])
    found = difference(a, a, peak=None)
    assert (found.not_finite, found.rmse, found.peak) == (0, 0, 1)
    assert difference(a, -a).not_finite == 1


def test_nothing_to_compare_is_not_a_number():
    found = difference(np.full((2, 2), np.nan), B)
    assert found.not_finite == 4
    assert all(math.isnan(value) for value in (found.rmse, found.mae, found.relative_mse, found.psnr))


def test_bands_of_rows_make_no_difference(monkeypatch):
    rng = np.random.default_rng(3)
    a, b = rng.random((2, 40, 30, 3)).astype(np.float32)
    whole = difference(a, b, peak=None)
    monkeypatch.setattr(metrics, "_BAND", 7 * 90)
    bands = difference(a, b, peak=None)
    assert bands.place == whole.place
    row, column, channel = whole.place
    assert whole.largest == abs(float(b[row, column, channel]) - float(a[row, column, channel]))
    for name in ("count", "mae", "mse", "relative_mse", "largest", "peak"):
        assert getattr(bands, name) == pytest.approx(getattr(whole, name), rel=1e-12)
    exact = b.astype(np.float64) - a.astype(np.float64)
    assert whole.rmse == pytest.approx(np.sqrt(np.mean(exact**2)), rel=1e-12)
    assert whole.relative_mse == pytest.approx(
        np.mean(exact**2 / (a.astype(np.float64) ** 2 + 0.01)), rel=1e-12
    )


def test_small_differences_of_large_values_keep_their_digits():
    a = np.full((300, 300), 1e4, np.float32)
    b = a.copy()
    b[7, 8] += np.float32(0.0009765625)
    found = difference(a, b)
    assert found.rmse == pytest.approx(0.0009765625 / 300, rel=1e-12)


def test_images_of_different_shape_are_a_programming_error():
    with pytest.raises(ValueError, match="different shape"):
        difference(A, B[:1])
