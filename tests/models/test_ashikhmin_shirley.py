"""Ashikhmin-Shirley: published values, isotropy, exponents without bound."""

from __future__ import annotations

import numpy as np

from illumcli.models.ashikhmin_shirley import AshikhminShirley

SLANTED = {"n": [0, 0, 1], "l": [1, 0.3, 1], "v": [-0.8, -0.1, 1]}


def test_published_values(cases, brdf, agree):
    for case in cases("ashikhmin_shirley"):
        i = case["inputs"]
        model = AshikhminShirley(
            diffuse=(i["Rd"],) * 3,
            specular=(i["Rs"],) * 3,
            exponent_u=float(i["nu"]),
            exponent_v=float(i["nv"]),
        )
        agree(brdf(model, i)[0], case)


def test_equal_exponents_make_it_isotropic(respond):
    model = AshikhminShirley(exponent_u=40.0, exponent_v=40.0)
    one, other = (respond(model, SLANTED | {"t": t}) for t in ([1, 0, 0], [0.3, 0.7, 0]))
    np.testing.assert_allclose(one, other, rtol=1e-13)


def test_a_mirror_leaves_nothing_to_diffuse():
    assert not AshikhminShirley(specular=(1, 1, 1)).diffuse_lobe(np.ones(2), np.ones(2)).any()
