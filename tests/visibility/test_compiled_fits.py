"""The compiled loop gives the bits of numpy: moments of cells, fits in windows, values between cells."""

from __future__ import annotations

import numpy as np
import pytest

from conftest import needs_loop
from illumcli.compiled import SWITCH
from illumcli.visibility import compiled_fits
from illumcli.visibility.compiled_fits import fit_loop
from illumcli.visibility.reconstruction import WINDOWS, finer, fit, interpolated, pyramid
from illumcli.visibility.sheets import Area


@pytest.fixture(autouse=True)
def _needs_the_loop(monkeypatch):
    needs_loop(fit_loop, monkeypatch)


def pixels(rng, rows, columns):
    """Pixels of which some are not there, some see nothing hidden, and regions have neither."""
    planes = rng.random((8, 4, rows, columns)).astype(np.float32)
    planes[2:] *= rng.gamma(0.2, size=(6, 1, 1, 1)).astype(np.float32)
    planes[0] *= rng.random(planes[0].shape) < 0.8
    planes[1] *= rng.random(planes[1].shape) < 0.3
    planes[1, :, : rows // 2] = 0
    planes[:, :, :, columns // 2 : columns // 2 + 9] = 0
    return planes


@pytest.mark.parametrize(("rows", "columns"), [(8, 8), (24, 72), (40, 36)])
def test_moments_and_fits_have_the_same_bits(monkeypatch, rows, columns):
    planes = pixels(np.random.default_rng(rows), rows, columns)
    compiled = pyramid(planes)
    monkeypatch.setenv(SWITCH, "0")
    for ours, theirs in zip(compiled, pyramid(planes), strict=True):
        assert ours.moments.tobytes() == theirs.moments.tobytes()
    for level, radius in WINDOWS:
        cells = compiled[level]
        for area in (Area(0, *cells.shape[:1], 0, cells.shape[1]), Area(0, 1, 1, 2)):
            monkeypatch.delenv(SWITCH)
            ours = fit(cells, radius, area)
            monkeypatch.setenv(SWITCH, "0")
            theirs = fit(cells, radius, area)
            assert (ours.leverage > 0).all()
            for name, values in vars(theirs).items():
                assert getattr(ours, name).tobytes() == values.tobytes(), name


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (3, 70), (33, 32)])
def test_bilinear_means_have_the_same_bits(monkeypatch, rows, columns):
    rng = np.random.default_rng(columns)
    coefficients = rng.normal(size=(8, rows, columns))
    coefficients[-1] = rng.random((rows, columns)) < 0.7
    features = rng.normal(size=(6, 4, rows, columns)).astype(np.float32)
    there = coefficients[-1] > 0
    compiled = finer(coefficients, there), interpolated(coefficients, features)
    monkeypatch.setenv(SWITCH, "0")
    for ours, theirs in zip(
        compiled, (finer(coefficients, there), interpolated(coefficients, features)), strict=True
    ):
        assert ours.tobytes() == theirs.tobytes()


def test_a_library_of_another_interface_is_not_used(monkeypatch):
    assert fit_loop() is not None
    monkeypatch.setattr(compiled_fits, "INTERFACE", -1)
    assert fit_loop() is None
