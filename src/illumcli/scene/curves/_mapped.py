"""Curves that may be shifted and scaled, over the surface too: scale * phi(rate * t - delay) + offset.

The four are the maps R, O, A and D of Gu et al.; phi is the curve that all points of a surface share.

References
----------
Gu, J., Tu, C.-I., Ramamoorthi, R., Belhumeur, P., Matusik, W., Nayar, S. (2006). Time-varying surface
appearance: acquisition, modeling and rendering. SIGGRAPH '06.
"""

from __future__ import annotations

from typing import Any

from illumcli.models._parameters import Mapped, Numbers
from illumcli.scene.curves._base import Curve, Over, ReadFile, rounded
from illumcli.scene.curves._keys import numeric
from illumcli.scene.frames import Moment
from illumcli.schema.description import Description
from illumcli.schema.fields import Number

MAPS = ("rate", "delay", "scale", "offset")


class MappedCurve(Curve):
    """A curve phi with four maps, each one number, or a texture or vertex attribute."""

    rate: Mapped[Number] = 1.0
    """How fast time passes: the curve at frame or time t has the value of rate * t - delay."""
    delay: Mapped[Number] = 0.0
    """How much later the curve begins, in frames or, where the curve is over time, in seconds."""
    scale: Mapped[Numbers] = (1.0, 1.0, 1.0)
    """Factor on each value; a number takes the first."""
    offset: Mapped[Numbers] = (0.0, 0.0, 0.0)
    """Added to each value; a number takes the first."""

    def axis(self, read: ReadFile) -> Over:
        """What the moments of the curve are."""
        raise NotImplementedError

    def phi_at(self, moment: Moment, read: ReadFile) -> Any:
        """The value of the curve itself."""
        raise NotImplementedError

    def phi(self, moment: Moment, read: ReadFile) -> dict[str, Any]:
        """The curve itself, in the form of `models._parameters.CurveOverSurface`."""
        raise NotImplementedError

    def is_plain(self) -> bool:
        """True if no map shifts or scales the curve."""
        defaults = {name: type(self).model_fields[name].default for name in MAPS}
        return all(getattr(self, name) == default for name, default in defaults.items())

    def value_at(self, moment: Moment, read: ReadFile) -> Any:
        if self.is_plain():
            return self.phi_at(moment, read)
        axis = self.axis(read)
        maps: dict[str, Any] = {name: getattr(self, name) for name in MAPS}
        if any(isinstance(value, Description) for value in maps.values()):
            given = {name: value for name, value in maps.items() if name in self.model_fields_set}
            return {"moment": rounded(getattr(moment, axis)), "phi": self.phi(moment, read), **given}
        at = maps["rate"] * getattr(moment, axis) - maps["delay"]
        frame, time = (at, at / moment.fps) if axis == "frame" else (at * moment.fps, at)
        value = self.phi_at(Moment(frame, time, moment.fps), read)
        if (maps["scale"], maps["offset"]) == ((1.0,) * 3, (0.0,) * 3):
            return value
        return _scaled(numeric(value), maps["scale"], maps["offset"])


def _scaled(value: Any, scale: tuple[float, ...], offset: tuple[float, ...]) -> Any:
    """scale * value + offset, component by component for three numbers."""
    if not isinstance(value, list):
        return rounded(scale[0] * value + offset[0])
    if len(value) != 3 and len(set(scale)) + len(set(offset)) > 2:
        raise ValueError(f"has {len(value)} numbers; scale and offset must be one number")
    factors = scale if len(value) == 3 else scale[:1] * len(value)
    terms = offset if len(value) == 3 else offset[:1] * len(value)
    return [_scaled(part, (a,) * 3, (b,) * 3) for part, a, b in zip(value, factors, terms, strict=True)]
