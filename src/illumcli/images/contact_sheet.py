"""Contact sheets: many pictures on one PNG, SVG or PDF, with labels."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.files.atomic import write_bytes
from illumcli.images.openimageio import oiio
from illumcli.images.sheet_layout import TEXT, Layout, Placed, Row, Sheet, laid_out
from illumcli.images.writer import ImageWriter

SUFFIXES = (".png", ".svg", ".pdf")
Pictures: TypeAlias = Sequence[Callable[[], NDArray[np.uint8]]]
"""Functions that read a picture: (H, W, 1 or 3) display values."""


def write_contact_sheet(
    path: str | os.PathLike[str],
    sheet: Sheet,
    pictures: Pictures,
    sizes: Sequence[tuple[int, int]],
    content: str,
) -> None:
    """Write a contact sheet.

    Parameters
    ----------
    pictures : sequence of callables
        Each is called once, row by row.
    sizes : sequence of (int, int)
        Height and width of each picture [pixels].
    content : str
        Hash of everything on the sheet, written into its metadata.

    Raises
    ------
    InputError
        matplotlib, which writes SVG and PDF, is not installed.
    OutputError
        The file cannot be written.
    """
    layout = laid_out(sheet, sizes)
    if Path(path).suffix.lower() == ".png":
        _write_png(path, layout, pictures, content)
    else:
        from illumcli.images.sheet_drawing import drawing

        scaled = [partial(_read_scaled, picture) for picture in pictures]
        write_bytes(Path(path), drawing(layout, scaled, content, Path(path).suffix.lower()[1:]))


def _write_png(path: str | os.PathLike[str], layout: Layout, pictures: Pictures, content: str) -> None:
    """Write the sheet band by band."""
    metadata = {"illum:content": content}
    with ImageWriter(path, layout.width, layout.height, dict.fromkeys("RGB", "uint8"), metadata) as writer:
        y = 0
        for row in layout.rows:
            writer.write_band(y, _band(row, layout.width, pictures))
            y += row.height


def _band(row: Row, width: int, pictures: Pictures) -> NDArray[np.uint8]:
    """(h, width, 3) a row of the sheet, on white."""
    band = np.full((row.height, width, 3), 255, np.uint8)
    for each in row.pictures:
        picture = _read_scaled(pictures[each.picture], each)
        band[each.y : each.y + each.height, each.x : each.x + each.width] = picture
    buffer = display_buffer(band)
    for text in row.texts:
        oiio.ImageBufAlgo.render_text(buffer, text.x, text.y, text.text, TEXT, "", (0.0, 0.0, 0.0))
    return np.asarray(buffer.get_pixels(oiio.UINT8))


def _read_scaled(read: Callable[[], NDArray[np.uint8]], place: Placed) -> NDArray[np.uint8]:
    """(height, width, 3) a picture, reduced where it is larger than its place."""
    picture = read()
    if picture.shape[:2] == (place.height, place.width):
        return np.broadcast_to(picture, (place.height, place.width, 3))
    source = display_buffer(np.broadcast_to(picture, (*picture.shape[:2], 3)))
    scaled = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, place.width, 0, place.height, 0, 1, 0, 3))
    return np.asarray(scaled.get_pixels(oiio.UINT8))


def display_buffer(pixels: NDArray[np.uint8]) -> oiio.ImageBuf:
    """A buffer of (H, W, 3) display values, on which OpenImageIO computes without conversion."""
    buffer = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8))
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels))
    return buffer
