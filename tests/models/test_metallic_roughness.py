"""Metallic-roughness: its ends, that it mixes linearly, the index, the narrowest lobe, ambient light."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.metallic_roughness import MetallicRoughness

UP = {"n": [0, 0, 1], "l": [0, 0, 1], "v": [0, 0, 1]}
SLANTED = {"n": [0, 0, 1], "l": [1, 0.3, 1], "v": [-0.8, -0.1, 1]}
COLOR = (0.9, 0.5, 0.1)


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_metal_along_the_normal_is_its_colour_over_4_pi_alpha_squared(brdf, roughness):
    model = MetallicRoughness(base_color=COLOR, metallic=1.0, roughness=roughness)
    np.testing.assert_allclose(brdf(model, UP), np.array(COLOR) / (4 * np.pi * roughness**4), rtol=1e-14)


def test_plastic_reflects_four_percent_and_the_rest_diffusely(brdf):
    model = MetallicRoughness(base_color=COLOR, roughness=1.0)
    np.testing.assert_allclose(brdf(model, UP), (0.96 * np.array(COLOR) + 0.01) / np.pi, rtol=1e-14)


def test_plastic_and_metal_mix_linearly(respond):
    plastic, mixed, metal = (
        respond(MetallicRoughness(base_color=COLOR, metallic=share, roughness=0.4), SLANTED)
        for share in (0.0, 0.3, 1.0)
    )
    np.testing.assert_allclose(mixed, 0.7 * plastic + 0.3 * metal, rtol=1e-14)


def test_an_index_of_one_reflects_nothing_along_the_normal(brdf):
    model = MetallicRoughness(base_color=COLOR, ior=1.0)
    np.testing.assert_allclose(brdf(model, UP), np.array(COLOR) / np.pi, rtol=1e-15)


def test_a_metal_has_no_diffuse_lobe():
    assert set(MetallicRoughness(metallic=1.0).lobes()) == {"specular"}
    assert set(MetallicRoughness(metallic=0.999).lobes()) == {"diffuse", "specular"}


def test_ambient_light_is_reflected_by_the_base_colour_of_metals_too():
    assert MetallicRoughness(base_color=COLOR, metallic=1.0).ambient_color() == COLOR
    assert MetallicRoughness(base_color=COLOR, ambient=(0.1, 0.2, 0.3)).ambient_color() == (0.1, 0.2, 0.3)


def test_the_narrowest_lobe_has_an_alpha_of_one_ten_thousandth(brdf):
    model = MetallicRoughness(base_color=(1.0,) * 3, metallic=1.0, roughness=0.0)
    np.testing.assert_allclose(brdf(model, UP), 1e8 / (4 * np.pi), rtol=1e-14)
