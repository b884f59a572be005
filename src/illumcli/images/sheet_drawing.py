"""Contact sheets as drawings, by matplotlib."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.files.seal import BLANK, sealed
from illumcli.images.sheet_layout import TEXT, Layout, Placed

DPI = 100
"""Pixels of a picture along an inch."""


def refuse_without_matplotlib(path: Path) -> None:
    """Raise InputError if a sheet of this suffix cannot be written here."""
    if path.suffix.lower() == ".png":
        return
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        advice = "install it: pip install 'illumcli[plot]', or write a .png"
        raise InputError(f"{path}: such sheets need matplotlib; {advice}") from None


def drawing(
    layout: Layout, pictures: Sequence[Callable[[Placed], NDArray[np.uint8]]], content: str, kind: str
) -> bytes:
    """A contact sheet as SVG or PDF, with letters as text; equal sheets are equal bytes.

    Parameters
    ----------
    pictures : sequence of callables
        Each reads a picture and reduces it to its place: (height, width, 3).
    content : str
        Hash of everything on the sheet, written into its metadata.
    kind : {'svg', 'pdf'}
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(
        {
            "svg.hashsalt": "illum",
            "svg.fonttype": "none",
            "pdf.fonttype": 42,
            "image.composite_image": False,
            "font.size": TEXT * 72 / DPI * 0.8,
        }
    ):
        figure = Figure(figsize=(layout.width / DPI, layout.height / DPI), dpi=DPI)
        y = layout.height
        for row in layout.rows:
            for each in row.pictures:
                picture = pictures[each.picture](each)
                figure.figimage(picture, each.x, y - each.y - each.height)
            for text in row.texts:
                figure.text(text.x / layout.width, (y - text.y) / layout.height, text.text, parse_math=False)
            y -= row.height
        out = io.BytesIO()
        of_svg = {"Date": None, "Identifier": content, "Keywords": BLANK}
        of_pdf = {"CreationDate": None, "Subject": content, "Keywords": BLANK}
        figure.savefig(out, format=kind, dpi=DPI, metadata=of_svg if kind == "svg" else of_pdf)
    return sealed(out.getvalue())
