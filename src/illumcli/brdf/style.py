"""How curves of a figure look: fonts of a paper, colours and dashes that differ in print."""

from __future__ import annotations

from typing import Any, NamedTuple

COLORS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
"""Distinguishable without red or green (Okabe and Ito 2008, Color universal design), yellow left out."""
CHANNEL_COLORS = ("#D55E00", "#009E73", "#0072B2")
"""Of R, G, B, from the same palette."""
DASHES = ((), (4, 1.5), (1.2, 1.2), (6, 1.5, 1.2, 1.5), (9, 2))
"""Lengths of dashes and gaps [line widths]: curves differ without colour, too."""

SETTINGS: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: equal files on all machines
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "lines.linewidth": 1.1,
    "lines.dash_capstyle": "butt",
    "grid.linewidth": 0.4,
    "grid.alpha": 0.35,
    "path.simplify": True,
    "svg.hashsalt": "illum",  # equal names within equal files
    "svg.fonttype": "none",  # text, which can be searched and edited
    "pdf.fonttype": 42,  # text in a TrueType font, as publishers ask for
}
"""matplotlib's settings for a drawing, by its names."""


class Style(NamedTuple):
    """Colour and dashes of a curve."""

    color: str
    dashes: tuple[float, ...]

    def line(self) -> dict[str, Any]:
        """Keywords of matplotlib's `plot`."""
        return {"color": self.color, "linestyle": (0, self.dashes) if self.dashes else "-"}


def style(number: int, channel: int | None = None) -> Style:
    """The style of the curve of this number; with a channel, in its colour."""
    color = COLORS[number % len(COLORS)] if channel is None else CHANNEL_COLORS[channel]
    return Style(color, DASHES[number % len(DASHES)])
