"""The two files of a picture in a report: a small JPEG, and its values as a script.

A page that is opened from disk may load scripts, but must not read other files. The script of a picture
calls `illumPixels(identity, picture)`. Its `data` are the values, packed by zlib, in base64: channel after
channel, first the lowest byte of all values, then the next, each byte as the difference to the left pixel's.
"""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.files.atomic import write_text
from illumcli.film.encode import picture as display_values
from illumcli.html_report.entries import Picture
from illumcli.images.colors import Colors, read_colors
from illumcli.images.jpeg import write_jpeg

THUMBNAIL = 360
"""The longer side of a thumbnail is at most so long [pixels]."""
MAX_PIXELS = 1 << 21
"""A larger picture is reduced; 1920 x 1080 is smaller."""
_LEVEL = 1  # of 9; files become a sixth smaller at 6, in five times the time


def write_picture(folder: Path, picture: Picture) -> None:
    """Write both files of a picture, unless they exist.

    Raises
    ------
    InputError, LimitError
        The picture cannot be read.
    OutputError
    """
    small, script = picture_files(folder, picture.identity)
    if not (small.is_file() and script.is_file()):
        colors = read_colors(picture.path)
        write_jpeg(small, thumbnail(colors, picture.exposure))
        write_text(script, pixels_script(picture, colors))


def picture_files(folder: Path, identity: str) -> tuple[Path, Path]:
    """The thumbnail and the script of a picture."""
    return folder / f"{identity}.jpg", folder / f"{identity}.js"


def thumbnail(colors: Colors, exposure: float) -> NDArray[np.uint8]:
    """(h, w, 1 or 3) the picture as a screen shows it, reduced by a whole number."""
    pixels = colors.pixels
    small = reduced(pixels, -(-max(pixels.shape[:2]) // THUMBNAIL))
    if colors.encoded:
        return np.rint(small * 255).astype(np.uint8)
    return np.asarray(display_values(small, exposure), np.uint8)


def pixels_script(picture: Picture, colors: Colors) -> str:
    """The script with the values of a picture."""
    height, width, channels = colors.pixels.shape
    factor = max(1, int(np.ceil(np.sqrt(height * width / MAX_PIXELS))))
    values = stored_values(reduced(colors.pixels, factor), colors.encoded)
    data = {
        "width": values.shape[1],
        "height": values.shape[0],
        "channels": channels,
        "type": values.dtype.name,
        "reduced": factor,
        "display": colors.encoded,
        "exposure": picture.exposure,
        "reading": _reading(colors),
        "data": base64.b64encode(zlib.compress(packed(values), _LEVEL)).decode(),
    }
    return f"illumPixels({json.dumps(picture.identity)}, {json.dumps(data)});\n"


def reduced(pixels: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Means of blocks of `factor` x `factor` pixels; those at the right and lower edge are smaller."""
    if factor == 1:
        return pixels
    height, width = pixels.shape[:2]
    rows, columns = np.arange(0, height, factor), np.arange(0, width, factor)
    sums = np.add.reduceat(np.add.reduceat(pixels, rows, axis=0), columns, axis=1)
    counts = np.multiply.outer(np.diff(rows, append=height), np.diff(columns, append=width))
    return (sums / counts[..., None]).astype(F)


def stored_values(pixels: NDArray[np.float32], encoded: bool) -> NDArray[np.generic]:
    """The values in the smallest type that holds them exactly: uint8 of display values, float16, float32."""
    if encoded:
        steps = np.rint(pixels * 255)
        if np.abs(pixels * 255 - steps).max() < 1e-3:  # a step of 16 bits is 0.004
            return steps.astype(np.uint8)
    with np.errstate(over="ignore"):
        half = pixels.astype(np.float16)
    return half if np.array_equal(half.astype(F), pixels) else pixels


def packed(values: NDArray[np.generic]) -> bytes:
    """The bytes of (H, W, C) values in the order of `data`, differences to the left."""
    height, width, channels = values.shape
    little = np.ascontiguousarray(np.moveaxis(values, -1, 0)).astype(values.dtype.newbyteorder("<"))
    planes = little.view(np.uint8).reshape(channels, height, width, values.dtype.itemsize)
    planes = np.ascontiguousarray(np.moveaxis(planes, -1, 1))
    planes[..., 1:] -= planes[..., :-1].copy()
    return planes.tobytes()


def _reading(colors: Colors) -> str:
    """The text that says what the numbers of a picture of data mean; empty for light."""
    texts = colors.metadata
    text = str(texts.get("illum:values", ""))
    for name in ("illum:scale", "illum:centre"):
        text = text.replace(name, str(texts.get(name, name)))
    return text
