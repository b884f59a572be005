"""What rays estimate at the points of a bake: obscurance outwards, thickness inwards."""

from __future__ import annotations

from dataclasses import replace

from illumcli.baking.points import Side
from illumcli.baking.settings import BakeSettings
from illumcli.records import Record
from illumcli.visibility.falloffs.linear import Linear
from illumcli.visibility.obscurance import Method


class Measure(Record):
    """A cosine-weighted mean of mu over the hemisphere on one side of the surface."""

    method: Method
    side: Side = 1
    channel: str = "obscurance"
    error: str = "standard_error"  # channel of its standard errors
    scale: float = 1.0  # value of the channel where the mean is 1
    with_bent: bool = False  # also the mean unoccluded direction, from the same rays


def measures(settings: BakeSettings, radius: float) -> tuple[Measure, ...]:
    """What the settings ask for; `radius` is that of the scene [scene units]."""
    wanted = settings.obscurance()
    method = Method(settings.samples, wanted.falloff, radius, wanted.sampler, wanted.faces)
    result = []
    if {"ao", "bent_normal"} & set(settings.what):
        result.append(Measure(method, with_bent="bent_normal" in settings.what))
    if "thickness" in settings.what:
        # the mean of min(d, limit): no hit within a bounded object is farther than the scene's diameter
        reach = wanted.falloff.reach(radius)
        limit = min(reach, 2 * radius)
        inside = replace(method, falloff=Linear(falloff="linear", max_distance=limit))
        result.append(Measure(inside, -1, "thickness", "thickness_error", limit))
    return tuple(result)
