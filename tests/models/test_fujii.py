"""Fujii: Oren-Nayar's two forms, how far it is from the full one, the albedo of a white surface."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.fujii import Fujii
from illumcli.models.lambert import Lambert
from illumcli.models.oren_nayar import OrenNayar
from illumcli.verification.claims import claims_of
from quadrature import albedo, all_pairs

SLANTED = {"n": [0, 0, 1], "l": [3, 1, 1], "v": [1, 2, 0.4]}
STEEP = np.radians(80)


def grey(Model, rho, **more):
    return Model(diffuse=(rho,) * 3, **more)


def test_it_claims_to_conserve_energy_without_sigma_alone():
    assert "conserving" in Fujii().claimed()
    assert claims_of("white", grey(Fujii, 1.0), is_fixed=True)[-1].claim == "conserving"
    results = claims_of("white", grey(Fujii, 1.0, sigma=0.25), is_fixed=True)
    assert {each.claim: each.passed for each in results} == dict.fromkeys(
        ["light", "reciprocal", "isotropic"], True
    )


@pytest.mark.parametrize("keys", [{"roughness": 0.0}, {"sigma": 0.0}])
def test_without_roughness_it_is_lambert(respond, keys):
    np.testing.assert_allclose(respond(Fujii(**keys), SLANTED), respond(Lambert(), SLANTED), rtol=1e-15)


def test_on_one_side_it_is_oren_nayars_qualitative_form_and_its_second_bounce(respond):
    rho, s2 = 0.7, 0.4**2
    one = respond(grey(Fujii, rho, sigma=0.4), SLANTED)
    other = respond(grey(OrenNayar, rho, sigma=0.4, form="qualitative"), SLANTED)
    n_l = 1 / np.sqrt(11)
    np.testing.assert_allclose(one, other + n_l * rho / np.pi * 0.17 * rho * s2 / (s2 + 0.13), rtol=1e-14)


@pytest.mark.parametrize(
    ("sigma", "rms", "largest", "qualitative"),
    [
        (0.1, 0.3, 4, 1.1),
        (0.3, 1.6, 23, 6.0),
        (0.5, 2.5, 36, 9.7),
        (1.0, 3.6, 53, 14.5),
        (1.57, 4.1, 60, 16.6),
    ],
)
def test_how_far_it_is_from_the_full_form(brdf, sigma, rms, largest, qualitative):
    """The table of the model's page."""
    full, fujii = grey(OrenNayar, 0.8, sigma=sigma), grey(Fujii, 0.8, sigma=sigma)
    simple = grey(OrenNayar, 0.8, sigma=sigma, form="qualitative")
    expected, weight, theta = all_pairs(full)
    mean = weight @ expected
    for model, percent in ((fujii, rms), (simple, qualitative)):
        off = np.sqrt(weight @ np.square(all_pairs(model)[0] - expected))
        assert 100 * off / mean == pytest.approx(percent, abs=0.051)
    off = np.abs(all_pairs(fujii)[0] - expected)[theta <= STEEP]
    assert 100 * off.max() / mean < largest + 0.5
    l, v = [np.sin(STEEP), 0, np.cos(STEEP)], [0, np.sin(STEEP), np.cos(STEEP)]
    one, other = (brdf(model, {"n": [0, 0, 1], "l": l, "v": v})[0] for model in (fujii, full))
    assert 100 * abs(one - other) / mean == pytest.approx(largest, abs=0.5)


def test_a_white_surface_reflects_all_light_at_grazing_alone():
    white = grey(Fujii, 1.0, roughness=1.0)
    found = [albedo(white, cosine) for cosine in (1.0, 0.5, 0.1, 0.001)]
    assert found == sorted(found)
    assert found[-1] == pytest.approx(1, abs=3e-4)


def test_with_sigma_a_white_surface_reflects_slightly_too_much():
    found = [albedo(grey(Fujii, 1.0, sigma=sigma), 1e-3) for sigma in (0.1, 0.2, 0.25, 0.3, 0.5, 1.0)]
    assert max(found) == pytest.approx(1.029, abs=1e-3)
