"""Light at each point if nothing stood between, and the lanes that get none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Ids, Vectors, dot, take_or_all
from illumcli.lights._base import Light
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class LitPoints(Record):
    """The lanes that a light reaches if nothing stands between, and what arrives there."""

    lane: Ids  # (K,) lanes with n.l > 0 and some light
    count: int  # all lanes
    l: Vectors  # (K, 3)
    distance: Floats  # (K,) in radii
    strength: Floats  # (K,) per unit of the light's colour


def lit(light: Light, frame: RenderSpace, position: Vectors, n: Vectors | None = None) -> LitPoints:
    """Lanes in the light's range that face it. Neither shadow rays nor models see the others.

    Without `n` no lane is taken to face away: vertices that a sample interpolates may face the light where
    the sample itself does not.
    """
    arriving = light.arriving(position, frame)
    reached = arriving.strength > 0
    if n is not None:
        reached &= dot(n, arriving.l) > 0
    lane = np.flatnonzero(reached).astype(np.int32)
    parts = (take_or_all(part, lane) for part in (arriving.l, arriving.distance, arriving.strength))
    return LitPoints(lane, len(position), *parts)


def reaching(light: Light, frame: RenderSpace, position: Vectors, lanes: NDArray[np.intp]) -> LitPoints:
    """These lanes, which are known to be lit, in ascending order."""
    arriving = light.arriving(take_or_all(position, lanes), frame)
    return LitPoints(lanes.astype(np.int32), len(position), arriving.l, arriving.distance, arriving.strength)
