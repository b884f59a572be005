"""Evaluators of the illumination models: the renderer's models, on terms that the renderer computes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, dot, take_rows
from illumcli.models._base import IlluminationModel
from illumcli.models.ashikhmin_shirley import AshikhminShirley
from illumcli.models.kajiya_kay import KajiyaKay
from illumcli.models.oren_nayar import OrenNayar, oren_nayar_terms
from illumcli.models.poulin_fournier import PoulinFournier
from illumcli.models.strauss import Strauss, Surface, strauss_fresnel, strauss_geometry, strauss_specular
from illumcli.models.ward import Ward
from illumcli.schema.families import member
from illumcli.shading import terms
from illumcli.shading.terms import evaluate
from illumcli.verification.inputs import Inputs


def response(model: IlluminationModel, n: Vectors, l: Vectors, **more: Vectors) -> Vectors:
    """(N, 3) sum of all lobes of the model; 0 where the surface faces away from the light.

    Parameters
    ----------
    more : (N, 3) or (3,)
        Other given terms that the model needs: `v`, `t`, and `light`, the light's colour.
    """
    out = np.zeros_like(l)
    lit = np.flatnonzero(dot(n, l) > 0)
    if lit.size:
        given = {"n": n, "l": l, **more}
        given = {name: value if value.ndim == 1 else take_rows(value, lit) for name, value in given.items()}
        out[lit] = sum(evaluate(model.lobes(), given).values())
    return out


def response_of_case(tag: str, inputs: Inputs) -> Floats:
    """(3,) the response of the model `tag` with the case's `parameters`, as a scene has them; `t` if it has a
    grain, and a white light."""
    model = member("illumcli.models", tag).model_validate({"model": tag, **inputs.value("parameters")})
    given = {key: inputs.unit(key) for key in ("n", "l", "v")}
    if not facing(inputs):
        return np.zeros(3, inputs.dtype)
    if "t" in inputs.values:
        given["t"] = inputs.tangent()
    return response(model, **given, light=np.ones(3, inputs.dtype))[0]


def brdf(model: IlluminationModel, inputs: Inputs, **more: Vectors) -> Floats:
    """(1,) f_r = response / n.l of a grey model; 0 if light or eye is below the horizon."""
    n, l, v = (inputs.unit(key) for key in ("n", "l", "v"))
    n_l = dot(n, l)
    if not (n_l[0] > 0 and dot(n, v)[0] > 0):
        return np.zeros_like(n_l)
    return response(model, n=n, l=l, v=v, **more)[:, 0] / n_l


def facing(inputs: Inputs) -> bool:
    """True if light and eye are both above the horizon."""
    n = inputs.unit("n")
    return bool(dot(n, inputs.unit("l"))[0] > 0 and dot(n, inputs.unit("v"))[0] > 0)


def computed_terms(inputs: Inputs, *names: str, **more: Vectors) -> list[Any]:
    """Terms of the renderer by name, computed from the case's n, l and v and from `more`."""
    buffers: dict[str, Any] = {key: inputs.unit(key) for key in ("n", "l", "v")} | more
    for node in terms.ordered_terms(names, tuple(buffers)):
        buffers[node.output] = node.run(buffers)
    return [buffers[name] for name in names]


def oren_nayar_full(inputs: Inputs) -> Floats:
    return brdf(OrenNayar(diffuse=inputs.color("albedo"), sigma=inputs.number("sigma")), inputs)


def oren_nayar_ab(inputs: Inputs) -> Floats:
    model = OrenNayar(diffuse=inputs.color("albedo"), sigma=inputs.number("sigma"), form="qualitative")
    return brdf(model, inputs)


def oren_nayar_bounces(inputs: Inputs) -> Floats:
    """[f1, f2] as parts of f_r, not clamped."""
    if not facing(inputs):
        return np.zeros(2, inputs.dtype)
    n_l, n_v, sin_l, sin_v, cos_phi = computed_terms(inputs, "n_l", "n_v", "sin_l", "sin_v", "cos_phi")
    one, two = oren_nayar_terms(n_l, n_v, sin_l, sin_v, cos_phi, inputs.scalars("sigma"))
    rho = inputs.scalars("albedo")
    return np.concatenate([one * rho, two * rho * rho]) / np.pi


def strauss(inputs: Inputs) -> Vectors:
    """Light times response plus ambient light times the ambient reflectance."""
    model = Strauss(color=inputs.color("color"), **strauss_parameters(inputs))
    light, ambient = (np.asarray(inputs.color(key), inputs.dtype) for key in ("light", "ambient"))
    out = ambient * np.asarray(model.ambient_color(), inputs.dtype)
    if facing(inputs):
        out += light * response(model, **{key: inputs.unit(key) for key in ("n", "l", "v")})[0]
    return out


def strauss_terms(inputs: Inputs) -> NDArray[Any]:
    """[r_d, r_n, F, G_i, G_r, r_j, r_s]."""
    white = Strauss(color=(1.0, 1.0, 1.0), **strauss_parameters(inputs))
    surface = Surface(*(inputs.scalars(key) for key in ("smoothness", "transparency", "kj", "kf", "kg")))
    n_l, n_v, sin_l, sin_v, gap_rv = computed_terms(inputs, "n_l", "n_v", "sin_l", "sin_v", "gap_rv")
    specular = strauss_specular(n_l, n_v, sin_l, sin_v, gap_rv, surface)
    r_d = np.asarray(white.diffuse_color(), inputs.dtype)[:1]
    return np.concatenate([r_d, (1 - surface.t) * surface.s**3, *specular])


def strauss_parameters(inputs: Inputs) -> dict[str, Any]:
    """The case's smoothness, metalness, transparency and constants."""
    return {k: inputs.number(k) for k in ("smoothness", "metalness", "transparency", "kj", "kf", "kg")}


def fresnel_of_strauss(inputs: Inputs) -> Floats:
    return strauss_fresnel(inputs.scalars("x"), inputs.scalars("kf"))


def geometry_of_strauss(inputs: Inputs) -> Floats:
    return strauss_geometry(1 - inputs.scalars("x"), inputs.scalars("kg"))


def kajiya_kay(inputs: Inputs) -> Floats:
    """A strand of hair without a surface that blocks light: the lobes are evaluated directly."""
    model = KajiyaKay(
        diffuse=inputs.color("kd"), specular=inputs.color("ks"), exponent=inputs.number("exponent")
    )
    values = evaluate(model.lobes(), {key: inputs.unit(key) for key in ("t", "l", "v")})
    return np.asarray(sum(values.values(), np.zeros((1, 3), inputs.dtype)))[:, 0]


def grained(Model: type[IlluminationModel], **keys: str) -> Callable[[Inputs], Floats]:
    """Evaluator of f_r of an anisotropic model with the case's tangent.

    Parameters
    ----------
    keys
        Parameter -> its key in the cases: colours for `diffuse` and `specular`, numbers for others.
    """

    def evaluate_case(inputs: Inputs) -> Floats:
        parameters: dict[str, float | tuple[float, float, float]] = {
            name: inputs.color(key) if name in ("diffuse", "specular") else inputs.number(key)
            for name, key in keys.items()
        }
        return brdf(Model.model_validate(parameters), inputs, t=inputs.tangent())

    return evaluate_case


CASES = {
    "oren_nayar_full": oren_nayar_full,
    "oren_nayar_ab": oren_nayar_ab,
    "oren_nayar_terms": oren_nayar_bounces,
    "strauss": strauss,
    "strauss_terms": strauss_terms,
    "strauss_fresnel": fresnel_of_strauss,
    "strauss_geometry": geometry_of_strauss,
    "ward": grained(Ward, diffuse="rho_d", specular="rho_s", alpha_x="ax", alpha_y="ay"),
    "ashikhmin_shirley": grained(
        AshikhminShirley, diffuse="Rd", specular="Rs", exponent_u="nu", exponent_v="nv"
    ),
    "kajiya_kay": kajiya_kay,
    "aniso_cylinder": grained(
        PoulinFournier, diffuse="kd", specular="ks", exponent="exponent", slope="theta_s"
    ),
}
