"""What a bake does to the colours of vertices. `COLOR_CHANGES` has a row for each choice of `--color`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats
from illumcli.records import Value


class ColorChange(Value):
    """Channels of colours that take obscurance."""

    channels: tuple[int, ...]
    """Of 0 red, 1 green, 2 blue, 3 alpha."""
    multiplies: bool = False
    """The values that are there are multiplied by it, not replaced."""

    @property
    def is_packed(self) -> bool:
        """True for numbers in a single channel, which no file format may encode as light."""
        return len(self.channels) == 1

    def applied(self, colors: Floats, w: Floats) -> NDArray[np.float64]:
        """(N, k) changed colours, from those that are there or white ones, (N, k), and obscurance, (N,)."""
        changed = np.array(colors, np.float64)
        values = np.asarray(w, np.float64)[:, None]
        rows = (slice(None), self.channels)
        changed[rows] = changed[rows] * values if self.multiplies else values
        return changed


COLOR_CHANGES: Mapping[str, ColorChange] = {
    "multiply": ColorChange((0, 1, 2), multiplies=True),
    "replace": ColorChange((0, 1, 2)),
    "r": ColorChange((0,)),
    "g": ColorChange((1,)),
    "b": ColorChange((2,)),
    "a": ColorChange((3,)),
}
