"""Contact sheets: many pictures on one PNG, each with its label."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.images.openimageio import oiio
from illumcli.images.writer import ImageWriter

CELL_WIDTH = 256  # of a picture [pixels]
_GAP = 8  # between pictures [pixels]
_TEXT = 14  # height of a label [pixels]


def write_contact_sheet(
    path: str | os.PathLike[str], pictures: Iterable[NDArray[np.uint8]], labels: Sequence[str], content: str
) -> None:
    """Write a contact sheet as PNG: pictures row by row, each scaled to a cell, its label below.

    Parameters
    ----------
    pictures : iterable of (H, W, 1 or 3) uint8
        Display values; read one at a time.
    labels : sequence of str
        One for each picture.
    content : str
        Hash of everything on the sheet, written into its metadata.
    """
    columns = max(1, min(len(labels), round((len(labels) * 1.6) ** 0.5)))
    cells = [_cell(picture, label) for picture, label in zip(pictures, labels, strict=True)]

    # Fill white below shorter cells, and the rest of the last row.
    tallest = max(len(cell) for cell in cells)
    blank = np.full((tallest, CELL_WIDTH + _GAP, 3), 255, np.uint8)
    cells = [np.concatenate([cell, blank[len(cell) :]]) for cell in cells]
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[k : k + columns], axis=1) for k in range(0, len(cells), columns)]
    sheet = np.concatenate(rows)

    metadata = {"illum:content": content}
    height, width = sheet.shape[:2]
    with ImageWriter(path, width, height, dict.fromkeys("RGB", "uint8"), metadata) as writer:
        writer.write_band(0, sheet)


def _cell(picture: NDArray[np.uint8], label: str) -> NDArray[np.uint8]:
    """(h, CELL_WIDTH + gap, 3) a picture, scaled, over its label, on white."""
    height = max(1, round(CELL_WIDTH * picture.shape[0] / picture.shape[1]))
    source = _display_buffer(np.repeat(picture, 3, axis=2) if picture.shape[2] == 1 else picture)
    scaled = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, CELL_WIDTH, 0, height, 0, 1, 0, 3))
    cell = _display_buffer(np.full((height + 2 * _GAP + _TEXT, CELL_WIDTH + _GAP, 3), 255, np.uint8))
    oiio.ImageBufAlgo.paste(cell, _GAP // 2, _GAP // 2, 0, 0, scaled)
    letters = CELL_WIDTH // 8
    text = label if len(label) <= letters else f"{label[: letters - 1]}…"
    oiio.ImageBufAlgo.render_text(cell, _GAP // 2, height + _GAP + _TEXT, text, _TEXT, "", (0.0, 0.0, 0.0))
    return np.asarray(cell.get_pixels(oiio.UINT8))


def _display_buffer(pixels: NDArray[np.uint8]) -> oiio.ImageBuf:
    """A buffer of (H, W, 3) display values, on which OpenImageIO computes without conversion."""
    buffer = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8))
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels))
    return buffer
