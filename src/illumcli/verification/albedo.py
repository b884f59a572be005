"""Evaluator of `directional_albedo`: a lobe's integral over the hemisphere, by quadrature."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, column_major
from illumcli.models._base import IlluminationModel
from illumcli.models.blinn_phong import BlinnPhong
from illumcli.models.lambert import Lambert
from illumcli.models.oren_nayar import OrenNayar
from illumcli.models.phong import Phong
from illumcli.verification.inputs import Inputs
from illumcli.verification.lobes import response

NODES = 24
"""Gauss-Legendre nodes per panel."""
HALVINGS = 24
"""Panels, each half as wide as the next, towards the normal: lobes of exponent 10^6 and more are resolved."""
RIGHT = np.pi / 2


def directional_albedo(inputs: Inputs) -> NDArray[np.float64]:
    """The albedo of one lobe for an eye direction: its response to uniform light, integrated.

    Responses are evaluated in the precision of the inputs and summed in float64.
    """
    kinds: dict[str, Callable[[], float]] = {
        "lambert": lambda: _eye_on_normal(Lambert(diffuse=inputs.color("albedo")), inputs),
        "phong_lobe_normal": lambda: _lobe_alone(Phong, inputs),
        "blinn_phong_lobe_normal": lambda: _lobe_alone(BlinnPhong, inputs),
        "oren_nayar_ab": lambda: _eye_anywhere(_qualitative(inputs), inputs),
    }
    return np.array([inputs.choose("kind", kinds)()])


def _qualitative(inputs: Inputs) -> OrenNayar:
    return OrenNayar(diffuse=inputs.color("albedo"), sigma=inputs.number("sigma"), form="qualitative")


def _lobe_alone(Model: type[Phong] | type[BlinnPhong], inputs: Inputs) -> float:
    """The albedo of the lobe times the cosine, which these models do not have."""
    model = Model(diffuse=(0.0, 0.0, 0.0), specular=(1.0, 1.0, 1.0), exponent=inputs.number("exponent"))
    return _eye_on_normal(model, inputs, np.cos)


def _eye_on_normal(
    model: IlluminationModel,
    inputs: Inputs,
    factor: Callable[[NDArray[np.float64]], NDArray[np.float64]] = np.ones_like,
) -> float:
    """The integral if the response does not depend on the azimuth."""
    edges = np.concatenate([[0], RIGHT * 0.5 ** np.arange(HALVINGS, -1, -1)])
    theta, weight = _panels(edges)
    values = _response(model, inputs, theta, np.zeros_like(theta), 0.0)
    return float(2 * np.pi * np.sum(values * factor(theta) * np.sin(theta) * weight))


def _eye_anywhere(model: IlluminationModel, inputs: Inputs) -> float:
    """The integral over both angles, split where Oren-Nayar's terms have a kink: at the eye's polar angle and
    at azimuths a right angle apart."""
    eye = inputs.number("theta")
    theta, weight = _panels(np.array([0, eye, RIGHT]))
    phi, around = _panels(np.array([0, RIGHT, np.pi]))
    thetas, phis = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    values = _response(model, inputs, thetas, phis, eye) * np.sin(thetas)
    return float(2 * np.sum(values * np.outer(weight, around).ravel()))


def _panels(edges: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss-Legendre nodes and weights over every interval between two edges."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    low, half = edges[:-1, None], np.diff(edges)[:, None] / 2
    return (low + half * (x + 1)).ravel(), (half * w).ravel()


def _response(
    model: IlluminationModel, inputs: Inputs, theta: NDArray[np.float64], phi: NDArray[np.float64], eye: float
) -> NDArray[np.float64]:
    """The model's response to light from (theta, phi), seen from the angle `eye` at azimuth 0."""
    l = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    v = np.broadcast_to([np.sin(eye), 0, np.cos(eye)], l.shape)
    n = np.broadcast_to([0.0, 0, 1], l.shape)
    vectors: dict[str, Vectors] = {
        name: column_major(vector, inputs.dtype) for name, vector in (("n", n), ("l", l), ("v", v))
    }
    return response(model, **vectors)[:, 0].astype(np.float64)


CASES = {"directional_albedo": directional_albedo}
