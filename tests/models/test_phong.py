"""Phong: published values, the clamp, the share that the normalised form reflects."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import column_major
from illumcli.models.phong import Phong
from illumcli.shading.terms import evaluate


def test_published_values(agree_under_lights):
    agree_under_lights("phong", Phong)


def test_published_colors(agree_under_lights):
    agree_under_lights("phong_rgb", Phong, lobe="r")


@pytest.mark.parametrize("exponent", [1e-6, 2.0, 2.5])
def test_no_highlight_beyond_a_right_angle(respond, exponent):
    """An even power of a negative cosine would light the wrong side."""
    away = {"n": [0, 0, 1], "l": [1, 0, 0.2], "v": [1, 0, 0.1]}
    assert not respond(Phong(diffuse=(0,) * 3, exponent=exponent), away).any()


@pytest.mark.parametrize("exponent", [0.0, 3.0, 50.0])
def test_normalised_reflects_its_shares_on_the_normal(exponent):
    node, weight = np.polynomial.legendre.leggauss(100)
    height = (1 + node) / 2
    l = column_major(np.stack([np.sqrt(1 - height**2), 0 * height, height], 1))
    up = column_major(np.tile([0.0, 0.0, 1.0], (len(l), 1)))
    model = Phong(diffuse=(0.5,) * 3, specular=(0.3,) * 3, exponent=exponent, normalised=True)
    lobes = evaluate(model.lobes(), {"n": up, "l": l, "v": up})
    for name, share in (("diffuse", 0.5), ("specular", 0.3)):
        assert 2 * np.pi * (lobes[name][:, 0] * weight / 2).sum() == pytest.approx(share, rel=1e-9)


def test_normalised_is_reciprocal(brdf):
    inputs = {"n": [0, 0, 1], "l": [1, 0.3, 1], "v": [-2, 0.1, 1]}
    model = Phong(normalised=True)
    there, back = brdf(model, inputs), brdf(model, inputs | {"l": inputs["v"], "v": inputs["l"]})
    np.testing.assert_allclose(there, back, rtol=1e-13)
