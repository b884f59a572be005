"""Formulas of `frame` and `time`."""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

from pydantic import AfterValidator

from illumcli.formula import checked, parse
from illumcli.scene.curves._base import rounded
from illumcli.scene.frames import Moment

VARIABLES = ("frame", "time")


def _checked(text: str) -> str:
    return checked(text, VARIABLES)


FrameFormula: TypeAlias = Annotated[str, AfterValidator(_checked)]


class NotFiniteError(ValueError):
    """A formula has no finite value at a frame."""


def formula_at(text: str, moment: Moment) -> int | float:
    """The value of a formula.

    Raises
    ------
    NotFiniteError
        It is no finite number at this frame.
    ValueError
        It is no formula.
    """
    value = float(parse(text, VARIABLES).value(moment.frame, moment.time))
    if not math.isfinite(value):
        raise NotFiniteError(f"'{text}' is not a finite number")
    return rounded(value)
