"""Evaluators of the Phong family: intensities as the texts print them, reflected and half vectors, angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, column_major, cross, dot, length, mirror
from illumcli.lights.point import Point
from illumcli.models.blinn_phong import BlinnPhong
from illumcli.models.phong import Phong
from illumcli.shading import terms
from illumcli.verification.inputs import Inputs
from illumcli.verification.lobes import response
from illumcli.verification.radiometry import HERE, polynomial

Model = type[Phong] | type[BlinnPhong]
LOBES: dict[str, Model] = {"r": Phong, "h": BlinnPhong}


def phong(inputs: Inputs) -> Floats:
    """I = Ie + Ia ka + sum over lights of f(d) I (kd n.l + ks (r.v)^e)."""
    return intensity(Phong, inputs)[:, 0]


def blinn_phong(inputs: Inputs) -> Floats:
    """The same with (n.h)^e."""
    return intensity(BlinnPhong, inputs)[:, 0]


def phong_rgb(inputs: Inputs) -> NDArray[np.floating]:
    return intensity(inputs.choose("lobe", LOBES), inputs)[0]


def intensity(Lobe: Model, inputs: Inputs) -> Vectors:
    """(1, 3) from lights given by their directions."""
    model = surface(Lobe, inputs)
    n, v = inputs.unit("n"), inputs.unit("v")
    total = emitted_and_ambient(inputs)
    for light in inputs.parts("lights"):
        lit = response(model, n=n, l=light.unit("l"), v=v)
        total += lit * light.scalars("f_d") * np.asarray(light.color("intensity"), total.dtype)
    return total


def phong_rgb_positional(inputs: Inputs) -> NDArray[np.floating]:
    """The same from lights and an eye at positions, by the renderer's point light."""
    model = surface(inputs.choose("lobe", LOBES), inputs)
    n, point = inputs.unit("n"), inputs.vectors("point")
    v = inputs.between("point", "eye")
    total = emitted_and_ambient(inputs)
    for light in inputs.parts("lights"):
        x, y, z = (float(c) for c in light.vectors("position")[0])
        lamp = Point(light="point", position=(x, y, z), attenuation=polynomial(inputs))
        arriving = lamp.sample_at(point, HERE)
        lit = response(model, n=n, l=arriving.l, v=v)
        total += lit * arriving.irradiance_scale * np.asarray(light.color("intensity"), total.dtype)
    return total[0]


def surface(Lobe: Model, inputs: Inputs) -> Phong | BlinnPhong:
    """The model with the case's kd, ks and exponent."""
    return Lobe(diffuse=inputs.color("kd"), specular=inputs.color("ks"), exponent=inputs.number("exponent"))


def emitted_and_ambient(inputs: Inputs) -> Vectors:
    """(1, 3) Ie + Ia ka."""
    emitted, ambient, ka = (np.asarray(inputs.color(key), inputs.dtype) for key in ("Ie", "Ia", "ka"))
    return column_major((emitted + ambient * ka)[None])


def reflect(inputs: Inputs) -> Vectors:
    n, l = inputs.unit("n"), inputs.unit("l")
    return mirror(l, n, dot(n, l))[0]


def halfway(inputs: Inputs) -> Vectors:
    return terms.h(terms.s(inputs.unit("l"), inputs.unit("v")))[0]


def nh_rv_angles(inputs: Inputs) -> Floats:
    """Angle between n and h, and between r and v."""
    n, l, v = (inputs.unit(key) for key in ("n", "l", "v"))
    return np.concatenate([angle(n, terms.s(l, v)), angle(mirror(l, n, dot(n, l)), v)])


def angle(a: Vectors, b: Vectors) -> Floats:
    """(N,) angle [rad] that keeps its digits near 0 and pi."""
    return np.arctan2(length(cross(a, b)), dot(a, b))


CASES = {
    f.__name__: f
    for f in (phong, blinn_phong, phong_rgb, phong_rgb_positional, reflect, halfway, nh_rv_angles)
}
