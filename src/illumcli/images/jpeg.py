"""Small JPEG files for previews."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import OutputError
from illumcli.files.atomic import AtomicFile
from illumcli.images.openimageio import oiio

QUALITY = 85  # of 100


def write_jpeg(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write (H, W, 1 or 3) display values as a JPEG.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT8)
    spec.attribute("Compression", f"jpeg:{QUALITY}")
    with AtomicFile(path) as part:
        output = oiio.ImageOutput.create("preview.jpg")
        assert output is not None
        done = output.open(os.fspath(part.path), spec)
        done = done and output.write_image(np.ascontiguousarray(pixels))
        if not (output.close() and done):
            raise OutputError(f"{path}: cannot be written: {output.geterror() or 'no reason given'}")
