"""Phong: published values, the clamp, the share that the normalised form reflects."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import column_major
from illumcli.models.phong import Phong
from illumcli.shading.terms import evaluate


def test_published_values(cases, respond, agree):
    for case in cases("phong"):
        i = case["inputs"]
        model = Phong(diffuse=(i["kd"],) * 3, specular=(i["ks"],) * 3, exponent=float(i["exponent"]))
        direct = sum(
            respond(model, i | light)[0] * light["intensity"] * light["f_d"] for light in i["lights"]
        )
        agree(i["Ie"] + i["Ia"] * i["ka"] + direct, case)


def test_published_colors(cases, respond, agree):
    for case in cases("phong_rgb"):
        i = case["inputs"]
        if i["lobe"] != "r":
            continue
        model = Phong(diffuse=tuple(i["kd"]), specular=(i["ks"],) * 3, exponent=float(i["exponent"]))
        direct = sum(
            respond(model, i | light) * np.array(light["intensity"]) * light["f_d"] for light in i["lights"]
        )
        agree(np.array(i["Ie"]) + np.array(i["Ia"]) * i["ka"] + direct, case)


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
