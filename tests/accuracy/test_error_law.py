"""The law of errors by contrast: its mean is the audit's, and it follows errors of any form."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.accuracy.error_law import standard_errors


def audited(square_error, contrast, random, draws):
    """Standard errors by a law that is fitted to noisy products at pixels drawn by contrast."""
    chances = (1 / contrast.size + contrast / contrast.sum()) / 2
    pixel = random.choice(contrast.size, draws, p=chances)
    f, c, d = random.normal(size=(3, draws)) * np.sqrt(square_error[pixel])
    weights = 1 / (chances[pixel] * contrast.size * draws)
    products = (f - c) * (f - d)
    return standard_errors(contrast, pixel, products, weights), float((products * weights).sum())


def test_it_follows_errors_that_fall_again_at_the_highest_contrasts():
    random = np.random.default_rng(5)
    contrast = random.exponential(size=50_000) ** 2
    true = 1e-4 * contrast * np.exp(-contrast / 3)
    errors, _ = audited(true, contrast, random, 8000)
    stated = np.square(errors.astype(float))
    order = np.argsort(stated)
    upto = np.cumsum(stated[order]) / stated.sum()
    for k in range(5):
        part = order[(upto > k / 5) & (upto <= (k + 1) / 5)]
        assert true[part].mean() == pytest.approx(stated[part].mean(), rel=0.35)
    assert stated[contrast > 20].mean() < stated[(contrast > 2) & (contrast < 4)].mean() / 5


def test_its_mean_is_that_of_the_audit():
    random = np.random.default_rng(6)
    contrast = random.random(4000)
    errors, mean = audited(1e-4 * contrast**2, contrast, random, 2000)
    assert np.square(errors.astype(float)).mean() == pytest.approx(mean, rel=1e-4)


def test_pixels_without_contrast_are_a_class_of_their_own():
    random = np.random.default_rng(7)
    contrast = np.where(np.arange(4000) < 3000, 0, random.random(4000))
    errors, _ = audited(contrast * 1e-4, contrast, random, 2000)
    assert not errors[contrast == 0].any()
    assert errors[contrast > 0].all()


@pytest.mark.parametrize("product", [0.0, 4e-6])
def test_pixels_of_one_contrast_have_one_error(product):
    count = np.full(100, product)
    errors = standard_errors(np.zeros(500), np.arange(100), count, np.full(100, 0.01))
    np.testing.assert_allclose(errors, np.sqrt(product), rtol=1e-6)


def test_errors_that_are_lost_in_noise_are_not_stated_as_0():
    products = np.tile([-2e-6, 1e-6], 50)
    errors = standard_errors(np.zeros(500), np.arange(100), products, np.full(100, 0.01))
    assert errors.min() > 0
