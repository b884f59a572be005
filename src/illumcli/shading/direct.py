"""Direct light: the response of every material's model to each light, and the sums over lobes and lights."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, dot, take_or_all, take_rows
from illumcli.lights._incident import LitPoints
from illumcli.rays.interaction import Hits
from illumcli.records import Record
from illumcli.shading.rates import ShadingPoints
from illumcli.shading.terms import evaluate, given_terms
from illumcli.shading.textures import PointMaterials

FEW_GROUPS = 8
"""So many groups are found one by one; a sort finds more of them faster."""


def groups(number: Ids, count: int) -> list[tuple[int, Ids | slice]]:
    """Indices by their number in 0..count-1: pairs (number, indices), only for numbers that occur."""
    if count == 1:
        return [(0, slice(None))] if len(number) else []
    if len(number) and (only := number.min()) == number.max():
        return [(int(only), slice(None))]
    sizes = np.bincount(number, minlength=count)
    present = np.flatnonzero(sizes)
    if len(present) <= FEW_GROUPS:
        return [(int(k), np.flatnonzero(number == k).astype(np.int32)) for k in present]
    order = np.argsort(number.astype(np.min_scalar_type(count)), kind="stable").astype(np.int32)
    ends = np.cumsum(sizes[present])
    return [(int(k), order[end - sizes[k] : end]) for k, end in zip(present, ends, strict=True)]


def take_group(values: NDArray[Any], index: Ids | slice) -> NDArray[Any]:
    """Values of a group of `groups`, not copied if the group is everything."""
    return values if isinstance(index, slice) else take_rows(values, index)


class Lobes(Record):
    """The response to one light by lobe: `diffuse` and `specular`, only lobes that some material has."""

    lobes: Mapping[str, Vectors]  # (C, 3) float32 each
    column: NDArray[np.intp] | None = None
    """(E,) which of the C rows is that of each point, if they are not the points themselves."""
    mended: Mapping[str, int] = field(default_factory=dict)
    """Material -> number of values that its model gave as negative or not finite, and that are 0."""

    def at_points(self, values: Vectors) -> Vectors:
        """(E, 3) what the points have of values like those of lobes."""
        return values if self.column is None else take_rows(values, self.column)


def direct(
    color: tuple[float, float, float],
    materials: PointMaterials,
    points: ShadingPoints,
    incident: LitPoints,
    v: Vectors | None = None,
    t: Vectors | None = None,
) -> Lobes:
    """The response to one light at the M samples, without shadows.

    Parameters
    ----------
    color : (3,)
        Intensity or irradiance of the light.
    v, t : (E, 3) float32, optional
        Unit vectors to the eye and tangents, if a model needs them.
    """
    known = {"n": points.n, "v": v, "t": t}
    given = {term: values for term, values in known.items() if values is not None}
    lobes = response(materials, incident, color, given)
    if points.are_samples:
        return lobes
    of_samples = {name: points.to_samples(lobes.at_points(rows)) for name, rows in lobes.lobes.items()}
    return Lobes(of_samples, mended=lobes.mended)


def response(
    materials: PointMaterials,
    incident: LitPoints,
    color: tuple[float, float, float],
    given: Mapping[str, Vectors],
) -> Lobes:
    """Radiance towards the eye at every point, without shadows.

    Models are evaluated at lit points only, and materials without lobes nowhere.

    Parameters
    ----------
    given : mapping
        (E, 3) vectors at all points: `n`, and `v` and `t` if a model needs them.
    """
    models, lobes = materials.materials.models, materials.materials.lobes
    batches, parameters = materials.materials.batches, materials.parameters
    names = sorted({name for each in lobes for name in each})
    count = len(incident.index)

    # Results in order of material, and one row of zeros, which points without light take theirs from.
    by_material = {name: np.zeros((3, count + 1), F) for name in names}
    column = np.full(incident.count, count, np.intp)  # of each point
    light = np.asarray(color, F)
    mended = Counter[str]()
    first = 0
    material = take_or_all(materials.number, incident.index)
    batch = material if len(batches.every) == len(models) else batches.batch.take(material)
    for number, group in groups(batch, len(batches.every)):
        # The lobes of these materials, with their parameters at these points if they vary.
        points, of_group = take_group(incident.index, group), take_group(material, group)
        one = int(of_group[0])
        if not lobes[one]:
            continue
        own_lobes = dict(lobes[one])
        if batches.every[number].differing:
            own_lobes = batches.every[number].at(batches.row.take(of_group)).lobes()
        elif parameters is not None and parameters.of_material[one]:
            own_lobes = parameters.model(models[one], one, points).lobes()

        # The given terms that they need.
        needed = given_terms(own_lobes)
        here = {term: take_or_all(given[term], points) for term in needed if term in given}
        here["l"] = take_group(incident.l, group)
        if "light" in needed:
            here["light"] = light / max(light.max(), np.finfo(F).tiny)

        # Response times irradiance.
        irradiance = light[:, None] * take_group(incident.irradiance_scale, group)
        last = first + len(points)
        wrong = Counter[str]()
        for name, value in evaluate(own_lobes, here, wrong).items():
            np.multiply(value.T, irradiance, out=by_material[name][:, first:last])
        mended[materials.materials.names[one]] += wrong.total()
        if len(points) == incident.count:
            return Lobes({name: columns[:, :count].T for name, columns in by_material.items()}, None, +mended)
        column[points] = np.arange(first, last)
        first = last

    # A gather brings them back to the order of the points, four times as fast as scattering each group.
    return Lobes({name: columns.T for name, columns in by_material.items()}, column, +mended)


def sum_lobes(hits: Hits, direct: Lobes, shadow: Floats | None = None) -> Vectors:
    """(M, 3) all lobes of one light, shadowed."""
    lobes = direct.lobes.values()
    return _shadowed(direct.at_points(total(lobes)) if lobes else black(hits), shadow)


def one_lobe(name: str, hits: Hits, direct: Lobes, shadow: Floats | None = None) -> Vectors:
    """(M, 3) one lobe of one light, shadowed."""
    has_lobe = name in direct.lobes
    return _shadowed(direct.at_points(direct.lobes[name]) if has_lobe else black(hits), shadow)


def irradiance(
    color: tuple[float, float, float],
    points: ShadingPoints,
    incident: LitPoints,
    shadow: Floats | None = None,
) -> Vectors:
    """(M, 3) I_d, the irradiance of one light on the surface, cosine included, shadowed."""
    out = np.zeros((incident.count, 3), F, order="F")
    cosine = dot(take_rows(points.n, incident.index), incident.l)
    out[incident.index] = (incident.irradiance_scale * cosine)[:, None] * np.asarray(color, F)
    return _shadowed(points.to_samples(out), shadow)


def add(hits: Hits, **parts: Vectors) -> Vectors:
    """(M, 3) the sum of the parts, in their order."""
    return total(parts.values()) if parts else black(hits)


def total(parts: Iterable[Vectors]) -> Vectors:
    """(N, 3) the sum of the parts, of which there is at least one, in their order."""
    first, *others = parts
    if not others:
        return first
    out = first + others[0]
    for part in others[1:]:
        out += part
    return out


def black(hits: Hits) -> Vectors:
    """(M, 3) zeros."""
    return np.zeros((len(hits.sample), 3), F, order="F")


def _shadowed(value: Vectors, shadow: Floats | None) -> Vectors:
    return value if shadow is None else value * shadow[:, None]
