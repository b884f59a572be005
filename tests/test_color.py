"""The sRGB curve and its inverse, luminance."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.color import from_srgb, luminance, to_srgb


@pytest.mark.parametrize(
    ("linear", "display"),
    [
        (0.0, 0.0),
        (1.0, 1.0),
        (0.001, 0.01292),
        (0.0031308, 0.040449936),
        (0.18, 0.46135612950),
        (0.5, 0.73535698305),
        (4.0, 1.8247963),
        (-0.001, -0.01292),
    ],
)
def test_hand_values(linear, display):
    assert to_srgb(np.array(linear)) == pytest.approx(display, rel=1e-6)
    assert from_srgb(np.array(display)) == pytest.approx(linear, rel=1e-6)


def test_curves_undo_each_other_and_never_fall():
    linear = np.linspace(0, 2, 100_001)
    np.testing.assert_allclose(from_srgb(to_srgb(linear)), linear, rtol=2e-6, atol=1e-12)
    assert (np.diff(to_srgb(linear)) > 0).all()
    assert (np.diff(from_srgb(linear)) > 0).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_precision_is_kept(dtype):
    assert to_srgb(np.ones(3, dtype)).dtype == dtype
    assert from_srgb(np.ones(3, dtype)).dtype == dtype


def test_luminance_of_white_is_1_and_of_green_most_of_it():
    assert luminance(np.ones((2, 3))) == pytest.approx(1, abs=1e-15)
    assert luminance(np.eye(3)).tolist() == [0.2126, 0.7152, 0.0722]
