"""Lambert: published values and an albedo that is the albedo."""

from __future__ import annotations

import numpy as np

from illumcli.models.lambert import Lambert


def test_published_values(cases, brdf, agree):
    for case in cases("lambert_brdf"):
        agree(brdf(Lambert(diffuse=(case["inputs"]["albedo"],) * 3), case["inputs"])[0], case)


def test_the_albedo_is_the_albedo():
    node, weight = np.polynomial.legendre.leggauss(4)
    response = Lambert(diffuse=(0.2, 0.5, 1.0)).diffuse_lobe((1 + node) / 2)
    np.testing.assert_allclose(np.pi * (weight @ response), [0.2, 0.5, 1.0], rtol=1e-14)
