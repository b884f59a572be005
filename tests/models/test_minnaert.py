"""Minnaert: Lambert as its case, the albedo on the normal, the flat Moon."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.lambert import Lambert
from illumcli.models.minnaert import Minnaert


def test_k_of_one_is_lambert(respond):
    inputs = {"n": [0, 0, 1], "l": [1, 0, 0.3], "v": [0, 1, 0.2]}
    np.testing.assert_allclose(respond(Minnaert(k=1.0), inputs), respond(Lambert(), inputs), rtol=1e-14)


@pytest.mark.parametrize("k", [0.0, 0.5, 2.0])
def test_the_albedo_seen_from_the_normal(k):
    node, weight = np.polynomial.legendre.leggauss(200)
    height = (1 + node) / 2
    response = Minnaert(k=k).diffuse_lobe(height, np.ones_like(height))[:, 0]
    assert np.pi * (response * weight).sum() == pytest.approx(0.8, rel=1e-4)


def test_k_of_a_half_makes_the_full_moon_flat():
    height = np.array([0.9, 0.5, 0.1])
    np.testing.assert_allclose(np.ptp(Minnaert(k=0.5).diffuse_lobe(height, height)), 0, atol=1e-15)
