"""Regression on moments: exact for linear quantities, leverages as of the hat matrix."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.visibility.regression import MOMENTS, moments, polynomials


@pytest.fixture
def samples():
    """Features that hang together, (6, 3, 40), of 40 samples in each of 3 sums, and weights."""
    random = np.random.default_rng(0)
    mixed = np.einsum("ij,jbk->ibk", random.normal(size=(6, 6)), random.normal(size=(6, 3, 40)))
    return mixed, random.random((3, 40)) + 0.5


def fitted(hidden, features, share):
    sums = np.empty((MOMENTS, 3))
    moments(share, hidden, features, lambda values, out: values.sum(axis=-1, out=out), sums)
    return polynomials(sums[:, :, None])


def test_a_linear_quantity_is_fitted_exactly(samples):
    features, share = samples
    slopes = np.array([1.0, -2.0, 0.5, 3.0, 0.0, -1.0])
    hidden = 0.3 + np.einsum("i,ibk->bk", slopes, features)
    fit = fitted(hidden, features, share)
    np.testing.assert_allclose(fit.at(features), hidden, atol=1e-3)
    np.testing.assert_allclose(fit.coefficients()[1:, :, 0].T, np.tile(slopes, (3, 1)), atol=1e-2)
    assert (fit.square[:, 0] < 1e-4 * (share * np.square(hidden)).sum(axis=1)).all()


def test_another_quantity_is_fitted_exactly(samples):
    features, share = samples
    fit = fitted(np.zeros((3, 40)), features, share)
    other = 2 - np.einsum("i,ibk->bk", np.arange(6.0), features)
    weight = share / share.sum(axis=1, keepdims=True)
    mean = (weight * other).sum(axis=1, keepdims=True)
    products = (weight * other * features).sum(axis=2, keepdims=True)
    np.testing.assert_allclose(fit.of_another(mean, products, features), other, atol=1e-3)
    assert (fit.at(features) == 0).all()


def test_leverages_are_those_of_the_hat_matrix(samples):
    features, _ = samples
    fit = fitted(np.zeros((3, 40)), features, np.ones((3, 40)))
    for k in range(3):
        design = np.vstack([np.ones(40), features[:, k]]).T
        hat = design @ np.linalg.inv(design.T @ design) @ design.T
        np.testing.assert_allclose(fit.leverage(features)[k], np.diag(hat), rtol=1e-4)


def test_the_sum_of_squares_is_that_of_the_residuals(samples):
    features, share = samples
    hidden = np.random.default_rng(4).random((3, 40))
    fit = fitted(hidden, features, share)
    residual = (share * np.square(fit.at(features) - hidden)).sum(axis=1)
    np.testing.assert_allclose(fit.square[:, 0], residual, rtol=1e-4)
