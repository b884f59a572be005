"""Layers in 8 bits: values are recovered as the metadata say, and no surface looks like the background."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.film.preview import DARKEST, reading, viewable
from illumcli.layers import FIXED, PER_LIGHT, Layer

SCALE, CENTRE = 4.0, (1.0, -2.0, 0.5)


def shown(name, values):
    return viewable(FIXED[name], np.array([values], np.float32), SCALE, CENTRE)[0]


@pytest.mark.parametrize("name", ["normal", "geometric_normal"])
def test_directions_come_back_and_nothing_is_black(name):
    given = np.array([[0.6, 0, -0.8], [0, 0, 0]])
    v = shown(name, given)
    np.testing.assert_allclose(2 * v[0] - 1, given[0], atol=1e-6)
    assert not v[1].any()
    assert reading(FIXED[name], SCALE, CENTRE) == {
        "illum:values": "normal = 2 v - 1; all 0 where nothing is seen"
    }


def test_positions_come_back_within_the_scale():
    given = np.array([[1.5, -3, 0], [0, 0, 0]])
    v = shown("position", given)
    np.testing.assert_allclose(CENTRE + SCALE * (2 * v[0] - 1), given[0], atol=1e-5)
    assert not v[1].any()
    metadata = reading(FIXED["position"], SCALE, CENTRE)
    assert (metadata["illum:scale"], metadata["illum:centre"]) == (SCALE, CENTRE)


def test_depth_comes_back_and_what_is_seen_is_never_black():
    v = shown("depth", [[2.0], [1e9], [0.0]])[:, 0]
    assert SCALE * (1 / v[0] - 1) == pytest.approx(2)
    assert v[1] == np.float32(DARKEST)
    assert v[2] == 0
    assert "illum:centre" not in reading(FIXED["depth"], SCALE, CENTRE)


def test_uv_show_their_fractions():
    np.testing.assert_allclose(shown("uv", [[1.25, -0.25]]), [[0.25, 0.75, 0]])


@pytest.mark.parametrize("name", ["object_id", "material_id", "triangle_id"])
def test_neighbouring_ids_differ_in_hue_and_0_is_black(name):
    v = shown(name, np.arange(6)[:, None])
    assert not v[0].any()
    assert np.abs(np.diff(v[1:], axis=0)).max(axis=1).min() > 0.1


def test_values_beyond_1_are_shown_against_their_white():
    layer = Layer("slope", "slope", ("slope.Y",), "data", white=180)
    assert viewable(layer, np.array([[[90], [180]]], np.float32), SCALE, CENTRE).tolist() == [[[0.5], [1]]]
    assert reading(layer, SCALE, CENTRE) == {"illum:values": "value = 180 v"}


def test_a_shadow_is_its_value_whatever_its_light_is_called():
    layer = PER_LIGHT["shadows"].of("lamp_id")
    assert viewable(layer, np.array([[[0.25]]], np.float32), SCALE, CENTRE).tolist() == [[[0.25]]]
    assert reading(layer, SCALE, CENTRE) == {"illum:values": "value = v"}
