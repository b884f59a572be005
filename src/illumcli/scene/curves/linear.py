"""Linear: straight from key to key.

Numbers, vectors and colours change component by component: colours in linear light, angles in degrees without
regard to full turns, directions as vectors, which are normalised afterwards.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from illumcli.keyframes import Interpolation
from illumcli.scene.curves._keyed import KeyedCurve, NumberKeys


class LinearCurve(KeyedCurve):
    curve: Literal["linear"]
    keys: NumberKeys
    """The number, numbers or colour at each frame or time; the first holds before its key, the last after its
    own."""

    interpolation: ClassVar[Interpolation] = "linear"
