"""Settings of a drawing of BRDFs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, TypeAlias, get_args

from pydantic import Field

from illumcli.records import Value

View: TypeAlias = Literal["polar", "cartesian", "across", "albedo", "sphere", "plane", "lobe", "all"]
Width: TypeAlias = Annotated[float, Field(ge=1, le=40)]
"""Of a whole drawing [inches]."""
CURVES = ("polar", "cartesian", "across", "albedo")
"""Views that are curves, of which several models may share one axis."""
VIEWS: tuple[str, ...] = get_args(View)[:-1]
DEFAULT_VIEWS: tuple[View, ...] = ("polar", "sphere", "plane", "lobe")
COLUMN = 3.3
"""Width of a column of a paper [inches]."""
PER_MODEL = 3.1
"""Width of a model's column where none is given [inches]."""


def in_order(views: Sequence[str]) -> tuple[str, ...]:
    """The views from the top of a drawing; `all` is every one."""
    return tuple(view for view in VIEWS if view in views or "all" in views)


class Plot(Value):
    """The views of a drawing, the quantities on their axes, and its size."""

    views: Sequence[str] = DEFAULT_VIEWS
    """Names of the views, from the top."""
    angles: Sequence[float] = (15.0, 40.0, 65.0)
    """Angles of incidence of the slices [degrees]."""
    log: bool = False
    """True for a logarithmic scale of slices and lobes."""
    times_cos: bool = False
    """True for the response, cosine included, instead of the BRDF."""
    overlay: bool = False
    """True if the curves of all models share an axis."""
    per_channel: bool = False
    """True for a curve of each channel instead of luminance."""
    labels: Sequence[str] = ()
    """What titles and legends call the models, in their order; by default their names."""
    width: float | None = None
    """Of the whole drawing [inches]; by default that of a column for each model."""

    @property
    def lobe_angle(self) -> float:
        """Angle of incidence of the lobe [degrees]: the middle one of the slices."""
        return sorted(self.angles)[len(self.angles) // 2]

    def shares_axis(self, view: str) -> bool:
        """True if all models are drawn on one axis of this view."""
        return self.overlay and view in CURVES

    def inches(self, models: int) -> float:
        """Width of the whole drawing."""
        if self.width is not None:
            return self.width
        return COLUMN if all(map(self.shares_axis, self.views)) else PER_MODEL * models


PLOT = Plot()
