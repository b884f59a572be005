"""The ground plane that `--ground` adds below a bake."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.errors import InputError
from illumcli.records import Value

GAP = 1e-4
"""Distance of the ground below the height that is asked for, in radii: faces there do not lie in it."""
SIZE = 1e3
"""Half the side of the ground, in radii."""


class Ground(Value):
    """A large square that faces upwards."""

    up: str
    """The axis that points up: `y`, or `-y` where y points down."""
    offset: float = 0.0
    """Of its height above the lowest vertex [scene units]."""

    AXES: ClassVar[tuple[str, ...]] = ("x", "y", "z", "-x", "-y", "-z")

    @classmethod
    def of(cls, text: str) -> Ground:
        """The ground of `AXIS` or `AXIS:OFFSET`.

        Raises
        ------
        InputError
            Another text.
        """
        up, separator, offset = text.partition(":")
        try:
            height = float(offset) if separator else 0.0
        except ValueError:
            height = math.nan
        if up not in cls.AXES or not math.isfinite(height):
            raise InputError(
                f"--ground {text}: is no ground; write the axis that points up, and how far above the lowest "
                "vertex it lies, as in y, -z or y:-0.1"
            )
        return cls(up, height)

    def square(self, vertices: NDArray[np.float32], radius: float) -> NDArray[np.float32]:
        """(4, 3) its corners, counter-clockwise from above, below vertices in radii, (N, 3)."""
        axis, sign = "xyz".index(self.up[-1]), -1 if self.up.startswith("-") else 1
        height = (sign * vertices[:, axis]).min(initial=0) + self.offset / radius - GAP
        a, b = (axis + 1) % 3, (axis + 2) % 3
        square = np.empty((4, 3), F)
        square[:, axis] = sign * height
        square[:, a] = [-SIZE, SIZE, SIZE, -SIZE]
        square[:, b] = np.multiply(sign, [-SIZE, -SIZE, SIZE, SIZE])
        return square
