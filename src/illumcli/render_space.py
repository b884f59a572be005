"""Render space: the scene recentred and scaled to unit radius, in which all rays are cast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.records import Value


class RenderSpace(Value):
    """The scene's centre and radius; in render space positions are in radii from the centre.

    Rays in float32 then lose the same few ulp whatever the size and position of the scene.
    """

    centre: tuple[float, float, float]  # [scene units]
    radius: float  # [scene units]

    def from_world(self, position: ArrayLike) -> NDArray[np.float64]:
        """Positions in the scene, (3,) or (N, 3) [scene units], as positions in render space [radii]."""
        return (np.asarray(position, np.float64) - self.centre) / self.radius

    def to_world(self, position: ArrayLike) -> NDArray[np.float64]:
        """Positions in render space, (3,) or (N, 3) [radii], as positions in the scene [scene units]."""
        return np.asarray(position, np.float64) * self.radius + self.centre
