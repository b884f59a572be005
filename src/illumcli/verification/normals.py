"""Evaluators of the normals of polygons, of vertices, and of surfaces given by a formula."""

from __future__ import annotations

from string import Formatter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.formula import Formula, parse
from illumcli.geometry import formula_normals, single_normals
from illumcli.geometry.corner_normals import Weights
from illumcli.verification.inputs import Inputs

WEIGHTS: dict[str, Weights] = {"equal": "equal", "area": "area", "angle": "angle"}
IMPLICIT = {
    "plane": "{a}*x + {b}*y + {c}*z",
    "ellipsoid": "(x/{a})**2 + (y/{b})**2 + (z/{c})**2",
    "paraboloid": "z - x**2/{a} - y**2/{b}",
    "torus": "(sqrt(x**2 + y**2) - {R})**2 + z**2 - {r}**2",
}
PARAMETRIC = {
    "sphere": ("{R}*cos(u)*sin(v)", "{R}*sin(u)*sin(v)", "{R}*cos(v)"),
    "cylinder": ("{R}*cos(u)", "{R}*sin(u)", "v"),
    "paraboloid": ("u", "v", "{a}*u**2 + {b}*v**2"),
    "torus": ("({R} + {r}*cos(v))*cos(u)", "({R} + {r}*cos(v))*sin(u)", "{r}*sin(v)"),
}


def polygon_normal_cross(inputs: Inputs) -> NDArray[Any]:
    return single_normals.cross_normal(inputs.vectors("vertices"), int(inputs.number("index")))


def polygon_normal_edge_average(inputs: Inputs) -> NDArray[Any]:
    return single_normals.edge_average_normal(inputs.vectors("vertices"))


def newell_plane(inputs: Inputs) -> NDArray[Any]:
    return single_normals.newell_plane(inputs.vectors("vertices"))


def plane_solve(inputs: Inputs) -> NDArray[Any]:
    return single_normals.plane_solve(*(inputs.vectors(key)[0] for key in ("p1", "p2", "p3")))


def vertex_normal(inputs: Inputs) -> NDArray[Any]:
    weights = inputs.choose("weighting", WEIGHTS)
    return single_normals.vertex_normal(
        inputs.vectors("vertex")[0], inputs.vectors("ring"), bool(inputs.value("closed")), weights
    )


def implicit_normal(inputs: Inputs) -> NDArray[Any]:
    """The gradient of f, by the derivatives of a scene's formulas."""
    f = parsed(inputs.choose("surface", IMPLICIT), inputs, ("x", "y", "z"))
    return formula_normals.implicit_normal(f, inputs.vectors("point").astype(np.float64))[0]


def parametric_normal(inputs: Inputs) -> NDArray[Any]:
    """df/du x df/dv."""
    x, y, z = (parsed(text, inputs, ("u", "v")) for text in inputs.choose("surface", PARAMETRIC))
    u, v = (inputs.scalars(key).astype(np.float64) for key in ("u", "v"))
    return formula_normals.parametric_normal(x, y, z, u, v)[0]


def parsed(text: str, inputs: Inputs, variables: tuple[str, ...]) -> Formula:
    """The formula with the case's constants inserted."""
    names = {name for _, name, _, _ in Formatter().parse(text) if name}
    return parse(text.format(**{name: f"({inputs.number(name)!r})" for name in names}), variables)


CASES = {
    f.__name__: f
    for f in (
        polygon_normal_cross,
        polygon_normal_edge_average,
        newell_plane,
        plane_solve,
        vertex_normal,
        implicit_normal,
        parametric_normal,
    )
}
