"""Lommel-Seeliger: the flat Moon, its albedo in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.lommel_seeliger import LommelSeeliger


def test_the_full_moon_is_flat():
    height = np.array([0.9, 0.5, 0.1])
    np.testing.assert_allclose(
        LommelSeeliger(diffuse=(1, 1, 1)).diffuse_lobe(height, height), 1 / (8 * np.pi)
    )


@pytest.mark.parametrize("eye", [1.0, 0.5, 0.1])
def test_albedo_in_closed_form(eye):
    """w / 2 (1 - b ln((1 + b) / b))."""
    node, weight = np.polynomial.legendre.leggauss(100)
    height = (1 + node) / 2
    response = LommelSeeliger(diffuse=(1, 1, 1)).diffuse_lobe(height, np.full_like(height, eye))[:, 0]
    assert np.pi * (response * weight).sum() == pytest.approx(
        0.5 * (1 - eye * np.log((1 + eye) / eye)), rel=1e-9
    )


def test_ambient_light_is_reflected_by_the_albedo_under_an_even_sky():
    node, weight = np.polynomial.legendre.leggauss(100)
    height = (1 + node) / 2
    albedo = 0.5 * (1 - height * np.log((1 + height) / height))
    assert LommelSeeliger(diffuse=(1, 1, 1)).ambient_color()[0] == pytest.approx(
        (albedo * height * weight).sum(), rel=1e-6
    )
