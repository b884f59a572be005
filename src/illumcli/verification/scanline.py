"""Evaluators of interpolated shading.

The scanline forms of the texts, edges first and then the span, live here: the renderer interpolates over
triangles, which agrees with them except on four-sided polygons and where edges are normalized first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, column_major, unit
from illumcli.geometry.single_normals import cross_normal
from illumcli.models.blinn_phong import BlinnPhong
from illumcli.rays.interaction import subtract_edge_terms
from illumcli.verification.inputs import Inputs
from illumcli.verification.lobes import response
from illumcli.verification.phong import emitted_and_ambient, surface

Point = NDArray[Any]  # (3,) or (2,)


def lerp(inputs: Inputs) -> Floats:
    """The value at distance a from v1 and b from v2, linearly interpolated."""
    a, b = inputs.scalars("a"), inputs.scalars("b")
    return (b * inputs.scalars("v1") + a * inputs.scalars("v2")) / (a + b)


def constant_shading(inputs: Inputs) -> Floats:
    """One value per facet, with light and eye along +z and no highlight."""
    n = unit(column_major(cross_normal(inputs.vectors("vertices"), 0)[None], inputs.dtype))
    up = column_major(np.array([[0, 0, 1]], inputs.dtype))
    model = BlinnPhong(diffuse=inputs.color("kd"), specular=(0.0, 0.0, 0.0))
    return (emitted_and_ambient(inputs) + inputs.scalars("Ii") * response(model, n=n, l=up, v=up))[:, 0]


def gouraud_triangle(inputs: Inputs) -> Floats:
    """Intensities on edge 1-2, on edge 1-3, and between them."""
    p1, p2, p3 = (inputs.points2(key) for key in ("p1", "p2", "p3"))
    return _gouraud(inputs, (p1, p2, "I1", "I2"), (p1, p3, "I1", "I3"))


def gouraud_quad(inputs: Inputs) -> Floats:
    """Intensities on edge 1-3, on edge 2-4, and between them."""
    p1, p2, p3, p4 = (inputs.points2(key) for key in ("p1", "p2", "p3", "p4"))
    return _gouraud(inputs, (p1, p3, "I1", "I3"), (p2, p4, "I2", "I4"))


def _gouraud(inputs: Inputs, *edges: tuple[Point, Point, str, str]) -> Floats:
    y = inputs.scalars("y")
    ends = []
    for start, end, first, last in edges:
        t = _along(y, start, end)
        ends.append((_mix(start[:1], end[:1], t), _mix(inputs.scalars(first), inputs.scalars(last), t)))
    (xa, ia), (xb, ib) = ends
    return np.concatenate([ia, ib, _mix(ia, ib, (inputs.scalars("x") - xa) / (xb - xa))])


def phong_shading_normal(inputs: Inputs) -> Vectors:
    """Unit normal of a pixel: interpolated along edges 1-2 and 1-3, then along the span."""
    p1, p2, p3 = (inputs.vectors(key) for key in ("p1", "p2", "p3"))
    n1, n2, n3 = (inputs.unit(key) for key in ("n1", "n2", "n3"))
    kinds: dict[str, Callable[..., Vectors]] = {"linear": linear, "quadratic": quadratic}
    between = inputs.choose("interpolation", kinds) if "interpolation" in inputs.values else linear
    y, x = inputs.scalars("y"), inputs.scalars("x")
    ta, tb = _along(y, p1[0], p2[0]), _along(y, p1[0], p3[0])
    pa, pb = _mix(p1, p2, ta), _mix(p1, p3, tb)
    na, nb = between(n1, n2, p2 - p1, ta), between(n1, n3, p3 - p1, tb)
    if between is quadratic or inputs.value("renormalise_edges"):
        na, nb = unit(na), unit(nb)
    ts = (x - pa[:, 0]) / (pb - pa)[:, 0]
    return unit(between(na, nb, pb - pa, ts))


def phong_shading(inputs: Inputs) -> Floats:
    """I of a pixel by Blinn-Phong with the interpolated normal."""
    n, l, v = column_major(phong_shading_normal(inputs)), inputs.unit("l"), inputs.unit("v")
    lit = inputs.scalars("Ii")[:, None] * response(surface(BlinnPhong, inputs), n=n, l=l, v=v)
    return (emitted_and_ambient(inputs) + lit)[:, 0]


def quadratic_normal(inputs: Inputs) -> Vectors:
    """n(s) along an edge, not normalized."""
    return quadratic(inputs.unit("n0"), inputs.unit("n1"), inputs.vectors("delta"), inputs.scalars("s"))


def linear(n0: Vectors, n1: Vectors, delta: Vectors, s: Floats) -> Vectors:
    """The linearly interpolated normal, not normalized (Phong 1975)."""
    return _mix(n0, n1, s[:, None])


def quadratic(n0: Vectors, n1: Vectors, delta: Vectors, s: Floats) -> Vectors:
    """The quadratic normal of van Overveld and Wyvill (1997), on an edge of the renderer's triangle."""
    origin, none = np.zeros_like(delta), np.zeros_like(s)
    corners = ((origin, n0, 1 - s), (delta, n1, s), (origin, n0, none))
    n = linear(n0, n1, delta, s)
    subtract_edge_terms(n, 3, corners.__getitem__)
    return n


def _along(y: Floats, start: Point, end: Point) -> Floats:
    """The parameter where scanline y crosses an edge, 0 at its start and 1 at its end."""
    return (y - start[1]) / (end[1] - start[1])


def _mix(first: Any, last: Any, t: Any) -> Any:
    return (1 - t) * first + t * last


CASES = {
    f.__name__: f
    for f in (
        lerp,
        constant_shading,
        gouraud_triangle,
        gouraud_quad,
        phong_shading_normal,
        phong_shading,
        quadratic_normal,
    )
}
