"""Vertex colours take the place of a model's surface colour, whatever it is called."""

from __future__ import annotations

from typing import Any

import pytest

from illumcli.models._parameters import VertexValues
from illumcli.models.lambert import Lambert
from illumcli.models.merl import Merl
from illumcli.models.metallic_roughness import MetallicRoughness
from illumcli.models.principled import Principled
from illumcli.models.strauss import Strauss
from illumcli.shading.materials import with_vertex_colors

COLOR = (0.25, 0.5, 1.0)


@pytest.mark.parametrize(
    ("model", "name"),
    [
        (Lambert(diffuse=COLOR), "diffuse"),
        (Strauss(color=COLOR), "color"),
        (MetallicRoughness(base_color=COLOR), "base_color"),
        (Principled(base_color=COLOR), "base_color"),
    ],
)
def test_vertex_colours_replace_or_multiply_the_surface_colour(model: Any, name: str) -> None:
    replaced, product = (with_vertex_colors(model, is_factor) for is_factor in (False, True))
    assert replaced.varying() == {name: VertexValues(vertex="color")}
    assert product.varying() == {name: VertexValues(vertex="color", factor=COLOR)}


def test_what_varies_already_or_is_black_or_measured_stays() -> None:
    varying = Principled(base_color=VertexValues(vertex="other"))
    black = Principled(base_color=(0.0, 0.0, 0.0))
    assert with_vertex_colors(varying, False) is varying
    assert with_vertex_colors(black, True) is black
    measured = Merl(file="a.binary")
    assert with_vertex_colors(measured, False) is measured
