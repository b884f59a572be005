"""Settings of a drawing of BRDFs."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.records import Value

VIEWS = ("polar", "sphere", "plane", "lobe")


class Plot(Value):
    """The rows of a drawing, and the quantities on their axes."""

    views: Sequence[str] = VIEWS
    """Names of the rows."""
    angles: Sequence[float] = (15.0, 40.0, 65.0)
    """Angles of incidence of the polar slices [degrees]."""
    log: bool = False
    """True for a logarithmic scale of slices and lobes."""
    times_cos: bool = False
    """True for the response, cosine included, instead of the BRDF."""

    @property
    def lobe_angle(self) -> float:
        """Angle of incidence of the lobe [degrees]: the middle one of the slices."""
        return sorted(self.angles)[len(self.angles) // 2]


PLOT = Plot()
