"""The sRGB curve and its inverse."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.color import from_srgb, refuse_nonfinite, to_srgb
from illumcli.errors import IllumError


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


def test_finite_bands_pass_and_others_tell_all():
    band = np.zeros((3, 4, 2))
    refuse_nonfinite(band, ("R", "Z"), "a.exr")
    band[1, 2, 0], band[2, 0, 1], band[2, 3, 1] = np.nan, np.inf, -np.inf
    with pytest.raises(IllumError) as caught:
        refuse_nonfinite(band, ("R", "Z"), "a.exr", y0=100)
    first, second = str(caught.value).split("\n")
    assert first == "a.exr: channel R: NaN or infinite in 1 pixels, the first at x 2, y 101"
    assert second.startswith(
        "a.exr: channel Z: NaN or infinite in 2 pixels, the first at x 0, y 102; nothing is"
    )
