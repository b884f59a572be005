"""Sequence: a file per frame, whose name holds the number: `bunny.####.obj` is bunny.0007.obj at frame 7.

The text alone, where a scene names a file, is short for this curve with the number `frame`.
"""

from __future__ import annotations

import math
import re
from typing import Any, Literal

from illumcli.scene.curves._base import Curve, ReadFile
from illumcli.scene.curves._formula import FrameFormula, formula_at
from illumcli.scene.frames import Moment


class SequenceCurve(Curve):
    curve: Literal["sequence"]
    file: str
    """Path with `#` for every digit; more digits are written if the number has more."""
    number: FrameFormula = "frame"
    """Formula of `frame` and `time` [s], rounded down, as `mod(frame, 12) + 1` for a cycle of 12 files."""

    def value_at(self, moment: Moment, read: ReadFile) -> Any:
        if "#" not in self.file:
            raise ValueError(f"{self.file} has no # for the number; write it as bunny.####.obj")
        number = math.floor(formula_at(self.number, moment))
        if number < 0:
            raise ValueError(f"the number of the file is {number}, must be at least 0")
        return re.sub("#+", lambda digits: f"{number:0{len(digits[0])}d}", self.file)
