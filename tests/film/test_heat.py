"""False colours order values by lightness."""

from __future__ import annotations

import numpy as np

from illumcli.color import from_srgb, luminance
from illumcli.film.heat import NOT_FINITE, heat


def lightness(colours):
    y = luminance(from_srgb(colours / 255))
    return np.where(y > 0.008856, 116 * np.cbrt(y) - 16, 903.3 * y)


def test_lightness_grows_evenly_from_black():
    values = np.linspace(0, 2, 257)
    light = lightness(heat(values[None], 2.0)[0])
    assert light[0] == 0
    assert light[-1] > 95
    assert np.abs(light - np.linspace(0, light[-1], 257)).max() < 4


def test_ends_hold_beyond_the_scale():
    colours = heat(np.array([[0, 1, 5]]), 1.0)[0]
    assert colours[0].tolist() == [0, 0, 0]
    assert colours[1].tolist() == colours[2].tolist() == [255, 250, 205]


def test_what_is_not_finite_stands_out():
    colours = heat(np.array([[np.nan, np.inf, 1.0]]), 1.0)[0]
    assert colours[:2].tolist() == [list(NOT_FINITE)] * 2
    assert colours[2].tolist() != list(NOT_FINITE)
