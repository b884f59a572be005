"""Principled: the models it contains, its distributions, its tints, the grain."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from illumcli.models._terms import Components
from illumcli.models.burley import Burley
from illumcli.models.metallic_roughness import MetallicRoughness
from illumcli.models.principled import Principled, _gtr1

COLOR = (0.9, 0.5, 0.1)
UP = {"n": [0, 0, 1], "l": [0, 0, 1], "v": [0, 0, 1], "t": [1, 0, 0]}
SLANTED = {"n": [0, 0, 1], "l": [1, 0.3, 1], "v": [-0.8, -0.1, 1], "t": [1, 0, 0]}


def below(model):
    """The model's diffuse lobe alone."""
    return type("", (), {"lobes": lambda: {"diffuse": model.diffuse_lobe}})


def test_the_diffuse_part_is_burleys(respond):
    found = respond(below(Principled(base_color=COLOR, roughness=0.7)), SLANTED)
    expected = respond(Burley(diffuse=COLOR, roughness=0.7), SLANTED)
    np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_along_the_normal_subsurface_is_five_eighths_more_than_half(respond):
    # 1 / (n_l + n_v) - 1/2 is 0 there
    found = respond(below(Principled(base_color=COLOR, subsurface=1.0)), UP)
    np.testing.assert_allclose(found, 0.625 / np.pi * np.array(COLOR), rtol=1e-15)


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_along_the_normal_the_highlight_is_that_of_metallic_roughness(brdf, roughness, metallic):
    own = Principled(base_color=COLOR, metallic=metallic, roughness=roughness)
    other = MetallicRoughness(base_color=COLOR, metallic=metallic, roughness=roughness)
    passed = 0.04 * (1 - metallic) * np.array(COLOR) / np.pi  # Burley's diffuse part is not less for it
    np.testing.assert_allclose(brdf(own, UP) - passed, brdf(other, UP), rtol=1e-14)


def test_metals_and_black_surfaces_without_sheen_have_no_diffuse_lobe():
    assert set(Principled(metallic=1.0, sheen=1.0).lobes()) == {"specular"}
    assert set(Principled(base_color=(0.0,) * 3).lobes()) == {"specular"}
    assert set(Principled(base_color=(0.0,) * 3, sheen=0.5).lobes()) == {"diffuse", "specular"}


def test_a_tint_has_the_luminance_of_white(respond):
    luminance = np.array([0.3, 0.6, 0.1])
    black = {"metallic": 0.0, "roughness": 0.5, "sheen": 1.0, "subsurface": 0.0}
    base = respond(below(Principled(base_color=COLOR, **black | {"sheen": 0.0})), SLANTED)
    white, tinted = (
        respond(below(Principled(base_color=COLOR, sheen_tint=tint, **black)), SLANTED) - base
        for tint in (0.0, 1.0)
    )
    assert tinted[0] > 1.5 * white[0]
    assert luminance @ tinted == pytest.approx(luminance @ white, rel=1e-13)


def test_black_has_no_hue(respond):
    black = {"base_color": (0.0,) * 3, "sheen": 1.0}
    tinted, plain = (respond(Principled(sheen_tint=tint, **black), SLANTED) for tint in (1.0, 0.0))
    np.testing.assert_array_equal(tinted, plain)


@pytest.mark.parametrize("width", [0.001, 0.05, 0.1])
def test_the_coats_distribution_is_normalised(width):
    # the integral of D_1 cos over the hemisphere, in sin^2 = u^8, which is dense at the normal
    node, weight = leggauss(200)
    u = (1 + node) / 2
    h = Components(u**8, 0 * u, 1 - u**8)
    area = np.pi * 8 * u**7 * weight / 2
    assert area @ _gtr1(h, np.array(width)) == pytest.approx(1, rel=1e-9)


def test_the_highlight_is_longer_along_the_tangent(respond):
    model = Principled(base_color=COLOR, metallic=1.0, roughness=0.3, anisotropic=0.9)
    along, across = (respond(model, {**UP, "v": v}) for v in ([0.5, 0, 1], [0, 0.5, 1]))
    assert np.all(along > 5 * across)


def test_a_coat_takes_nothing_from_what_is_below(respond):
    bare, half, full = (respond(Principled(clearcoat=share), SLANTED) for share in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(full - bare, 2 * (half - bare), rtol=1e-12)
    assert np.all(full > bare)


def test_it_has_a_grain_only_if_its_highlight_is_not_round():
    assert not Principled().has_grain()
    assert Principled(anisotropic=0.1).has_grain()
