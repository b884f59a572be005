"""Curves: values that vary with the frame, one file each, whose name is the tag of ``curve:`` in a scene."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from illumcli.scene.curves._base import Curve
from illumcli.schema.families import Family

CURVES = "illumcli.scene.curves"

AnyCurve: TypeAlias = Annotated[Curve, Family(CURVES, "curve")]
