"""Filled gutters."""

from __future__ import annotations

import numpy as np

from illumcli.atlas.fill import filled

F = np.float32


def test_known_texels_stay_and_the_others_are_between_them():
    random = np.random.default_rng(0)
    values, is_known = random.random((37, 52), F), random.random((37, 52)) < 0.02
    out = filled(values, is_known)
    np.testing.assert_array_equal(out[is_known], values[is_known])
    assert out.min() >= values[is_known].min()
    assert out.max() <= values[is_known].max()


def test_one_known_texel_fills_everything():
    is_known = np.zeros((7, 5), bool)
    is_known[6, 4] = True
    np.testing.assert_array_equal(filled(np.where(is_known, F(0.3), F(np.nan)), is_known), F(0.3))


def test_unknown_texels_have_values_of_those_nearby():
    # two charts: left 0, right 1
    values = np.tile(np.arange(64, dtype=F) >= 32, (64, 1)).astype(F)
    is_known = np.zeros((64, 64), bool)
    is_known[:, 8:12] = is_known[:, 52:56] = True
    out = filled(values, is_known)
    assert (out[:, :14] == 0).all()
    assert (out[:, 48:] == 1).all()


def test_mipmaps_of_charts_mix_in_no_background():
    values, is_known = np.full((256, 256), 7, F), np.zeros((256, 256), bool)
    is_known[100:117, 31:90] = True
    values[is_known] = 0.25
    out = filled(values, is_known)
    np.testing.assert_array_equal(out, F(0.25))


def test_nothing_known_is_open():
    np.testing.assert_array_equal(filled(np.zeros((3, 4), F), np.zeros((3, 4), bool)), 1)
