"""One light: groups the lit points by material and asks each model for its response."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, dot, take_or_all, take_rows
from illumcli.lights._incident import LitPoints
from illumcli.rays.interaction import Hits
from illumcli.shading.rates import ShadingPoints
from illumcli.shading.terms import evaluate, words
from illumcli.shading.textures import PointMaterials


def groups(number: Ids, count: int) -> list[tuple[int, Ids | slice]]:
    """Which lanes have which number of 0..count-1: (number, lanes), only numbers that occur."""
    if count == 1:
        return [(0, slice(None))] if len(number) else []
    if len(number) and (only := number.min()) == number.max():
        return [(int(only), slice(None))]
    have = np.flatnonzero(np.bincount(number, minlength=count))
    return [(int(k), np.flatnonzero(number == k).astype(np.int32)) for k in have]


def pick(values: NDArray[Any], lanes: Ids | slice) -> NDArray[Any]:
    """Values of these lanes, without a copy where it is all of them."""
    return values if isinstance(lanes, slice) else take_rows(values, lanes)


def direct(
    color: tuple[float, float, float],
    materials: PointMaterials,
    points: ShadingPoints,
    incident: LitPoints,
    v: Vectors | None = None,
    t: Vectors | None = None,
) -> dict[str, Vectors]:
    """One light's response per lobe at the M samples, its shadow not applied.

    Parameters
    ----------
    color : (3,)
        Intensity or irradiance of the light.
    v, t : (E, 3) float32, optional
        Unit vectors to the eye and tangents, where some model asks for them.

    Returns
    -------
    dict
        `diffuse` and `specular`, (M, 3) float32, only lobes that some material has.
    """
    known = {"n": points.n, "v": v, "t": t}
    given = {word: values for word, values in known.items() if values is not None}
    at_points = response(materials, incident, color, given)
    return {name: points.to_samples(value) for name, value in at_points.items()}


def response(
    materials: PointMaterials,
    incident: LitPoints,
    color: tuple[float, float, float],
    given: Mapping[str, Vectors],
) -> dict[str, Vectors]:
    """Light leaving towards the eye at every point, per lobe, shadows not yet applied.

    A material without lobes is not evaluated.

    Parameters
    ----------
    given : mapping
        (E, 3) words of the models at all points: `n`, and `v`, `t` where some model wants them.

    Returns
    -------
    dict
        `diffuse` and `specular`, (E, 3) float32, only lobes that some material has.
    """
    models, lobes = materials.materials.models, materials.materials.lobes
    material, parameters = materials.number, materials.parameters
    names = sorted({name for each in lobes for name in each})
    count = len(incident.index)
    made = {name: np.zeros((3, count + 1), F) for name in names}  # by material; the last is of unlit points
    place = np.full(incident.count, count, np.intp)  # where each point's light is among them
    power = np.asarray(color, F)
    first = 0
    for number, lanes in groups(take_or_all(material, incident.index), len(models)):
        if not lobes[number]:
            continue
        at = pick(incident.index, lanes)
        own = dict(lobes[number])
        if parameters is not None and parameters.of_material[number]:
            own = parameters.model(models[number], number, at).lobes()
        wanted = words(own)
        here = {word: take_or_all(given[word], at) for word in wanted if word in given}
        here["l"] = pick(incident.l, lanes)
        if "light" in wanted:
            here["light"] = power / max(power.max(), np.finfo(F).tiny)
        arriving = power[:, None] * pick(incident.irradiance_scale, lanes)
        last = first + len(at)
        for name, value in evaluate(own, here).items():
            np.multiply(value.T, arriving, out=made[name][:, first:last])
        if len(at) == incident.count:
            return {name: columns[:, :count].T for name, columns in made.items()}
        place[at] = np.arange(first, last)
        first = last
    # gathered: to scatter them takes four times as long
    return {name: take_rows(columns.T, place) for name, columns in made.items()}


def sum_lobes(hits: Hits, direct: dict[str, Vectors], shadow: Floats | None = None) -> Vectors:
    """(M, 3) one light: all its lobes, with its shadow."""
    return _shadowed(add(hits, **direct), shadow)


def one_lobe(name: str, hits: Hits, direct: dict[str, Vectors], shadow: Floats | None = None) -> Vectors:
    """(M, 3) one lobe of one light, with its shadow."""
    return _shadowed(direct[name] if name in direct else black(hits), shadow)


def irradiance(
    color: tuple[float, float, float],
    points: ShadingPoints,
    incident: LitPoints,
    shadow: Floats | None = None,
) -> Vectors:
    """(M, 3) I_d of one light: what arrives on the surface, its cosine included."""
    out = np.zeros((incident.count, 3), F, order="F")
    cosine = dot(take_rows(points.n, incident.index), incident.l)
    out[incident.index] = (incident.irradiance_scale * cosine)[:, None] * np.asarray(color, F)
    return _shadowed(points.to_samples(out), shadow)


def add(hits: Hits, **parts: Vectors) -> Vectors:
    """(M, 3) the sum of the parts, in their order."""
    if not parts:
        return black(hits)
    first, *others = parts.values()
    if not others:
        return first
    out = first + others[0]
    for part in others[1:]:
        out += part
    return out


def black(hits: Hits) -> Vectors:
    """(M, 3) no light."""
    return np.zeros((len(hits.sample), 3), F, order="F")


def _shadowed(value: Vectors, shadow: Floats | None) -> Vectors:
    return value if shadow is None else value * shadow[:, None]
