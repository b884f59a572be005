"""Images whose numbers are data of a model, such as distributions of facet normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def read_numbers(path: str) -> NDArray[np.float32]:
    """(H, W, 3) the numbers of an image as stored, integers as 0..1, the first row on top.

    Grey is three equal channels. Integers are multiplied by their alpha: what is transparent is black.

    Raises
    ------
    InputError
        No such file, no image, or numbers that are not finite.
    """
    from illumcli.images.reader import read_texture  # OpenImageIO is loaded where an image is read

    image = read_texture(path, "linear")
    count = len(image.channels)
    values = image.at(np.arange(image.height * image.width)).reshape(image.height, image.width, count)
    colors = values[..., :3] if count >= 3 else np.repeat(values[..., :1], 3, axis=-1)
    if count in (2, 4) and image.tables is not None:
        colors = colors * values[..., -1:]
    return np.ascontiguousarray(colors)
