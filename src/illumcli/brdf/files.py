"""Files of figures: equal drawings are equal files."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""Without date and version, so that equal drawings are equal files."""


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """The file of a figure.

    Parameters
    ----------
    kind : {'png', 'svg', 'pdf'}
    """
    _fix_layout(figure)
    file = io.BytesIO()
    figure.savefig(file, format=kind, metadata=METADATA[kind])
    return _with_numbered_clips(file.getvalue()) if kind == "svg" else file.getvalue()


def _fix_layout(figure: Figure) -> None:
    """Lay out the figure; last digits of matplotlib's solver vary from run to run, and are rounded off."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes in figure.axes:
        left, bottom, width, height = (round(each, 6) for each in axes.get_position(original=True).bounds)
        axes.set_position((left, bottom, width, height))


def _with_numbered_clips(svg: bytes) -> bytes:
    """An SVG whose clip paths are named by number; matplotlib names them after places in memory."""
    numbers: dict[bytes, int] = {}
    named = rb'(?<=clipPath id="p)[0-9a-f]+|(?<=url\(#p)[0-9a-f]+(?=\))'
    return re.sub(named, lambda name: b"%d" % numbers.setdefault(name[0], len(numbers)), svg)
