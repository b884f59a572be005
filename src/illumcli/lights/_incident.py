"""Incident light at shading points, without occlusion: which points a light can reach, and its irradiance."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, take_or_all, take_rows
from illumcli.lights._base import Light, LightSample
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class LitPoints(Record):
    """The points that a light reaches if nothing occludes it, with the incident light there."""

    index: NDArray[np.intp]  # (K,) the points with n.l > 0 and some light; ascending if K is `count`
    count: int  # of all points
    l: Vectors  # (K, 3) unit, to the light
    distance: Floats  # (K,) to the light, in radii
    irradiance_scale: Floats  # (K,) irradiance facing the light, per unit of the light's colour


class Placed(Protocol):
    """Anything with positions: shading points, surface interactions."""

    @property
    def position(self) -> Vectors:
        """(N, 3) in radii."""


class Oriented(Placed, Protocol):
    """Anything with positions and shading normals."""

    @property
    def n(self) -> Vectors:
        """(N, 3) unit."""


def incident(
    light: Light, render_space: RenderSpace, points: Oriented, ray_order: NDArray[np.intp] | None = None
) -> LitPoints:
    """The points in the light's range that face it; at others no model is evaluated.

    Parameters
    ----------
    ray_order : (N,) optional
        The points in the order in which shadow rays are cast.
    """
    sample = light.sample_at(points.position, render_space)
    reached = sample.irradiance_scale > 0
    reached &= dot(points.n, sample.l) > 0
    return _lit(sample, reached, ray_order)


def shadow_candidates(
    light: Light, render_space: RenderSpace, interaction: Placed, ray_order: NDArray[np.intp] | None = None
) -> LitPoints:
    """The samples in the light's range, facing it or not: a vertex that a sample is interpolated from may
    face the light where the sample does not."""
    sample = light.sample_at(column_major(interaction.position, F), render_space)
    return _lit(sample, sample.irradiance_scale > 0, ray_order)


def unshadowed(incident: LitPoints, shadow: Floats) -> LitPoints:
    """The lit points that are not in shadow; points must be samples."""
    lit = np.flatnonzero(take_rows(shadow, incident.index) != 0)
    if len(lit) == len(incident.index):
        return incident
    parts = (take_rows(part, lit) for part in (incident.l, incident.distance, incident.irradiance_scale))
    return LitPoints(take_rows(incident.index, lit), incident.count, *parts)


def unshadowed_by_shadow(
    light: Light, render_space: RenderSpace, points: Oriented, shadow: Floats
) -> LitPoints:
    """The same without the light at the other points: `shadow` is 0 where the light does not reach."""
    index = np.flatnonzero(shadow != 0)
    sample = light.sample_at(take_or_all(points.position, index), render_space)
    parts = sample.l, sample.distance, sample.irradiance_scale
    return LitPoints(index, len(points.position), *parts)


def _lit(sample: LightSample, reached: NDArray[np.bool_], order: NDArray[np.intp] | None) -> LitPoints:
    if order is None or reached.all():
        order = np.arange(len(reached))
    index = order[reached.take(order, mode="wrap")]
    parts = (take_or_all(part, index) for part in (sample.l, sample.distance, sample.irradiance_scale))
    return LitPoints(index, len(sample.l), *parts)
