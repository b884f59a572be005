"""Known parameters are found in noisy measurements, within the standard errors that are stated."""

from __future__ import annotations

import numpy as np
import pytest

from fitting.recovery import CASES, fitted, z_scores


@pytest.mark.parametrize("case", ["ward", "ward, isotropic", "cook_torrance, ggx", "lafortune", "oren_nayar"])
def test_fits_from_all_starts_find_the_truth(case):
    fit, z = fitted(case, count=1200, with_errors=case != "ward")
    assert np.abs(z).max() < 4.5, z
    assert np.sqrt(np.mean(np.square(z))) < 2
    assert fit.optimum.reached >= 1
    assert fit.chi_squared is None or 0.9 < fit.chi_squared < 1.1


def test_standard_errors_cover_the_truth():
    for with_errors in (True, False):
        z = z_scores("oren_nayar", range(60), count=400, with_errors=with_errors)
        squares = np.square(z).mean(axis=1)
        assert abs(squares.mean() - 1) < 4.5 * squares.std(ddof=1) / np.sqrt(len(z)), squares.mean()


@pytest.mark.parametrize("metric", ["cube_root", "log"])
def test_other_metrics_find_the_truth_where_noise_is_small(metric):
    _, z = fitted("oren_nayar", count=800, metric=metric, level=0.05)
    assert np.abs(z).max() < 4.5, z


@pytest.mark.slow
@pytest.mark.parametrize("with_errors", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_standard_errors_cover_the_truth_for_every_model(case, with_errors):
    z = z_scores(case, range(100), with_errors=with_errors)
    squares = np.square(z).mean(axis=1)
    assert abs(squares.mean() - 1) < 4.5 * squares.std(ddof=1) / np.sqrt(len(z)), squares.mean()
    assert np.all(np.abs(z.mean(axis=0)) < 4.5 / np.sqrt(len(z))), z.mean(axis=0)
