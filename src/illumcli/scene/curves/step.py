"""Step: each value holds until the next key; for names, files, whole numbers and whole parts of a scene."""

from __future__ import annotations

from typing import ClassVar, Literal

from illumcli.keyframes import Interpolation
from illumcli.scene.curves._keyed import KeyedCurve, Keys


class StepCurve(KeyedCurve):
    curve: Literal["step"]
    keys: Keys
    """The value from each frame or time on, of any kind; the first holds before its key, too."""

    interpolation: ClassVar[Interpolation] = "step"
