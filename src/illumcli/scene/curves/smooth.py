"""Smooth: a cubic from key to key, at rest at the first and the last, that stays between the keys around it.

Values change component by component, as in `linear`. The slope at a key is 0 if it is an extreme, otherwise
the weighted harmonic mean of the slopes on both sides, by Fritsch and Butland (1984).
"""

from __future__ import annotations

from typing import ClassVar, Literal

from illumcli.keyframes import Interpolation
from illumcli.scene.curves._keyed import KeyedCurve, NumberKeys


class SmoothCurve(KeyedCurve):
    curve: Literal["smooth"]
    keys: NumberKeys
    """The number, numbers or colour at each frame or time; the first holds before its key, the last after its
    own."""

    interpolation: ClassVar[Interpolation] = "smooth"
