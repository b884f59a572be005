"""One light: groups the lit points by material and asks each model for its response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, take_or_all, take_rows
from illumcli.lights._incident import LitPoints
from illumcli.models._base import IlluminationModel
from illumcli.shading.terms import evaluate, words
from illumcli.shading.textures import Parameters


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


def response(
    models: Sequence[IlluminationModel],
    lobes: Sequence[Mapping[str, Any]],
    material: Ids,
    incident: LitPoints,
    color: tuple[float, float, float],
    given: Mapping[str, Vectors],
    parameters: Parameters | None = None,
) -> dict[str, Vectors]:
    """Light leaving towards the eye at every point, per lobe, shadows not yet applied.

    Parameters
    ----------
    models, lobes : sequences
        By material number; a material without lobes is not evaluated.
    material : (E,) int32
        Of each point.
    incident : Lit
        The points the light reaches.
    color : (3,)
        Intensity or irradiance of the light.
    given : mapping
        (E, 3) words of the models at all points: `n`, and `v`, `t` where some model wants them.
    parameters : Parameters, optional
        What varies over the surface, at all points.

    Returns
    -------
    dict
        `diffuse` and `specular`, (E, 3) float32, only lobes that some material has.
    """
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
