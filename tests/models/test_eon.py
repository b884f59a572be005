"""EON: the white furnace, the averages that its closed forms stand for, Lambert and Fujii as its parts."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.eon import A_SLOPE, MEAN_SLOPE, Eon, loss
from illumcli.models.fujii import Fujii
from illumcli.models.lambert import Lambert
from quadrature import albedo

COSINES = (1.0, 0.7, 0.3, 0.05, 0.003)


@pytest.mark.parametrize("roughness", [0.0, 1e-6, 0.1, 0.5, 1.0])
def test_a_white_surface_reflects_all_light(roughness):
    white = Eon(diffuse=(1.0,) * 3, roughness=roughness)
    for cosine in COSINES:
        assert albedo(white, cosine) == pytest.approx(1, abs=2e-14)


def test_a_single_bounce_loses_what_the_closed_form_says():
    """The first lobe alone is Fujii's, up to its constant."""
    r = 0.6
    A = 1 / (1 + A_SLOPE * r)
    for cosine in COSINES:
        sine = np.sqrt((1 - cosine) * (1 + cosine))
        lost = A * r * loss(np.array([cosine]), np.array([sine]))[0]
        assert 1 - albedo(Fujii(diffuse=(1.0,) * 3, roughness=r), cosine) == pytest.approx(lost, abs=2e-14)


def test_the_mean_of_the_losses():
    node, weight = np.polynomial.legendre.leggauss(80)
    theta = (1 + node) * np.pi / 4
    lost = loss(np.cos(theta), np.sin(theta))
    mean = weight @ (lost * np.sin(2 * theta)) * np.pi / 4
    assert mean == pytest.approx(A_SLOPE - MEAN_SLOPE, rel=1e-12)


def test_without_roughness_it_is_lambert(respond):
    inputs = {"n": [0, 0, 1], "l": [3, 1, 0.1], "v": [-1, 2, 0.4]}
    np.testing.assert_allclose(respond(Eon(roughness=0.0), inputs), respond(Lambert(), inputs), rtol=1e-15)


def test_light_that_bounces_between_facets_is_coloured_more():
    """The albedo falls short of rho, more where rho is small: a red surface is more saturated."""
    bright, dark = (albedo(Eon(diffuse=(rho,) * 3, roughness=1.0), 0.6) / rho for rho in (0.9, 0.1))
    assert dark < bright < 1
