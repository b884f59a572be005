"""How a scene is recentred and scaled to unit radius before any ray is cast."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Value


class RenderSpace(Value):
    """The scene's centre and radius: inside the renderer every position is in radii from the centre.

    Float32 rays then lose the same few ulp whatever the scale and place of a scene.
    """

    centre: tuple[float, float, float]  # [scene units]
    radius: float  # [scene units]

    def from_world(self, position: object) -> NDArray[np.float64]:
        """Positions of the scene, (3,) or (N, 3), in radii from its centre."""
        return (np.asarray(position, np.float64) - self.centre) / self.radius

    def to_world(self, position: object) -> NDArray[np.float64]:
        """Positions in radii from the centre as positions of the scene."""
        return np.asarray(position, np.float64) * self.radius + self.centre
