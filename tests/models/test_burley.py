"""Burley's diffuse: its factor where light and eye share a direction, mirror each other, or stand upright."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.burley import Burley

UP = [0.0, 0.0, 1.0]


def direction(degrees):
    return [np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))]


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_seen_and_lit_from_the_normal_it_is_lambert(brdf, roughness):
    model = Burley(diffuse=(0.2, 0.5, 0.9), roughness=roughness)
    found = brdf(model, {"n": UP, "l": UP, "v": UP})
    np.testing.assert_allclose(found, np.array([0.2, 0.5, 0.9]) / np.pi, rtol=1e-15)


@pytest.mark.parametrize(("roughness", "factor"), [(0.0, 0.25), (0.25, 1.0), (1.0, 6.25)])
def test_at_grazing_towards_the_light_it_is_half_plus_twice_the_roughness_squared(brdf, roughness, factor):
    grazing = direction(90 - 1e-9)
    found = brdf(Burley(diffuse=(1.0,) * 3, roughness=roughness), {"n": UP, "l": grazing, "v": grazing})
    np.testing.assert_allclose(found * np.pi, factor, rtol=1e-9)


@pytest.mark.parametrize("roughness", [0.0, 0.5, 1.0])
def test_away_from_the_light_grazing_edges_keep_a_quarter(brdf, roughness):
    there, here = direction(90 - 1e-9), direction(-90 + 1e-9)
    found = brdf(Burley(diffuse=(1.0,) * 3, roughness=roughness), {"n": UP, "l": there, "v": here})
    np.testing.assert_allclose(found * np.pi, 0.25, rtol=1e-9)


def test_between_it_follows_the_formula(brdf):
    n_l, n_v, cos2 = np.cos(np.radians(50)), np.cos(np.radians(20)), np.cos(np.radians(35)) ** 2
    edge = 0.5 + 2 * 0.7 * cos2
    factor = (1 + (edge - 1) * (1 - n_l) ** 5) * (1 + (edge - 1) * (1 - n_v) ** 5)
    found = brdf(
        Burley(diffuse=(0.6,) * 3, roughness=0.7), {"n": UP, "l": direction(50), "v": direction(-20)}
    )
    np.testing.assert_allclose(found, 0.6 / np.pi * factor, rtol=1e-14)
