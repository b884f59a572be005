"""Light to the integers of a picture: exposure, transfer curve, rounding, alpha."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.color import to_srgb
from illumcli.errors import IllumError
from illumcli.film.encode import exposed, picture, srgb8, srgb16, unpremultiplied


def single(*values):
    return np.array(values, np.float32)


@pytest.mark.parametrize(
    ("linear", "step"),
    [
        (0, 0),
        (1, 255),
        (0.5, 188),
        (0.18, 118),
        (0.214041, 127),
        (0.0031308, 10),
        (-1, 0),
        (7, 255),
        (1e38, 255),
    ],
)
def test_hand_values(linear, step):
    assert srgb8(single(linear)) == step


def test_every_float_rounds_as_in_double_precision():
    bits = np.arange(0, 0x3F900000, 977, dtype=np.uint32)  # 0 to beyond 1
    linear = bits.view(np.float32)
    exact = np.rint(255 * np.clip(to_srgb(linear.astype(np.float64)), 0, 1))
    np.testing.assert_array_equal(srgb8(linear), exact)
    np.testing.assert_array_equal(srgb8(-linear), 0)


def test_both_sides_of_every_border_round_as_in_double_precision():
    step = (np.arange(1, 256) - 0.5) / 255
    border = np.where(step <= 0.04045, step / 12.92, ((step + 0.055) / 1.055) ** 2.4).astype(np.float32)
    for linear in (np.nextafter(border, np.float32(0)), border, np.nextafter(border, np.float32(1))):
        exact = np.rint(255 * to_srgb(linear.astype(np.float64)))
        np.testing.assert_array_equal(srgb8(linear), exact)


def test_steps_never_fall_and_all_occur():
    ramp = srgb8(np.linspace(-0.1, 1.1, 100_001, dtype=np.float32))
    assert (np.diff(ramp.astype(int)) >= 0).all()
    assert len(np.unique(ramp)) == 256


def test_sixteen_bits_refine_eight():
    linear = np.linspace(0, 1, 10_001, dtype=np.float32)
    assert np.abs(srgb16(linear) / 257 - srgb8(linear)).max() <= 0.5 + 1 / 257
    assert srgb16(single(0, 1, 2, -1)).tolist() == [0, 65535, 65535, 0]


@pytest.mark.parametrize(("stops", "factor"), [(0, 1), (1, 2), (-2, 0.25), (0.5, 2**0.5)])
def test_exposure_counts_in_stops(stops, factor):
    np.testing.assert_allclose(exposed(single(0.1, 3), stops), single(0.1, 3) * factor, rtol=1e-6)


def test_exposure_lightens_colour_and_not_alpha():
    band = single(0.1, 0.2, 0.3, 0.5).reshape(1, 1, 4)
    pixel = picture(band, exposure=1)[0, 0]
    assert pixel.tolist() == [*srgb8(single(0.4, 0.8, 1.2)), 128]


def test_colour_is_divided_by_alpha():
    """A half covered white pixel is white at half alpha, not grey."""
    band = np.array([[[0.5, 0.5, 0.5, 0.5], [0, 0, 0, 0], [1, 1, 1, 1]]], np.float32)
    assert picture(band)[0].tolist() == [[255, 255, 255, 128], [0, 0, 0, 0], [255, 255, 255, 255]]
    assert unpremultiplied(single(0.2, 0.3)[:, None], single(0, 0)[:, None]).ravel().tolist() == [
        np.float32(0.2),
        np.float32(0.3),
    ]


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize(("bits", "dtype"), [(8, np.uint8), (16, np.uint16)])
def test_pictures_have_the_shape_of_the_band(channels, bits, dtype):
    band = np.random.default_rng(0).random((5, 7, channels), np.float32)
    assert picture(band, bits=bits).shape == band.shape
    assert picture(band, bits=bits).dtype == dtype
    np.testing.assert_array_equal(picture(np.asfortranarray(band), bits=bits), picture(band, bits=bits))


@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False, width=32), min_size=4, max_size=4),
    st.floats(-64, 64),
)
def test_any_finite_pixel_makes_a_picture(pixel, stops):
    assert picture(single(*pixel).reshape(1, 1, 4), stops).shape == (1, 1, 4)


def test_light_beyond_single_precision_is_white():
    band = single(1e38, 1e38, -1e38, 1e-38).reshape(1, 1, 4)
    assert picture(band, exposure=64)[0, 0].tolist() == [255, 255, 0, 0]
    assert picture(band[..., :3], exposure=64)[0, 0].tolist() == [255, 255, 0]


def test_band_is_left_as_it_was():
    band = np.random.default_rng(0).random((5, 7, 4), np.float32)
    before = band.copy()
    picture(band, 1.0)
    np.testing.assert_array_equal(band, before)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(bad):
    band = np.zeros((4, 6, 4), np.float32)
    band[2, 5, 3] = bad
    with pytest.raises(
        IllumError, match=r"a.png: channel A: NaN or infinite in 1 pixels, the first at x 25, y 12"
    ):
        picture(band, place="a.png", y0=10, x0=20)
