"""Images as bytes, in the two formats that every reader of glTF knows: PNG and JPEG."""

from __future__ import annotations

import struct
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.color import to_srgb
from illumcli.images.png import PngFile
from illumcli.images.reader import read_image
from illumcli.mesh_files import embedded_image, image_within
from illumcli.mesh_files._files import content
from illumcli.mesh_files.gltf.embed import media_type

_PROFILES = (b"iCCP", b"cHRM", b"gAMA")
_NAMES = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}


def encoded_image(path: str) -> tuple[bytes, str]:
    """The bytes of a PNG or JPEG with its pixels as they are, of other images converted to a PNG; and the
    media type. The image is a file, or one within a mesh file, ``FILE#images[N]``.

    Raises
    ------
    InputError
        The file does not exist or is no image.
    """
    within = image_within(path)
    data = content(Path(path)) if within is None else embedded_image(Path(within[0]), within[1])
    kind = media_type(data)
    if kind == "image/png":
        return without_profile(data), kind
    if kind == "image/jpeg":
        return data, kind
    image = read_image(path)
    names = [name for name in "RGBAY" if name in image.channels]
    pixels = np.stack([image.channels[name] for name in names], axis=-1)
    if not image.encoded:  # linear and premultiplied
        colors = [k for k, name in enumerate(names) if name != "A"]
        alpha = image.channels.get("A", np.ones_like(pixels[..., 0]))[..., None]
        linear = np.divide(pixels[..., colors], alpha, out=pixels[..., colors], where=alpha > 0)
        pixels[..., colors] = to_srgb(np.clip(linear, 0, 1))
    return png_bytes(np.rint(255 * np.clip(pixels, 0, 1)).astype(np.uint8), srgb=True), "image/png"


def without_profile(data: bytes) -> bytes:
    """A PNG without the chunks that describe its colour space, which readers of glTF must ignore (3.8.4)."""
    pieces, at = [data[:8]], 8
    while at + 8 <= len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        if kind not in _PROFILES:
            pieces.append(data[at : at + 12 + length])
        at += 12 + length
    return b"".join(pieces)


def png_bytes(pixels: NDArray[Any], srgb: bool) -> bytes:
    """A PNG of (H, W, C) integers of 8 or 16 bits; `srgb` as of `ImageWriter`."""
    height, width, count = pixels.shape
    channels = dict.fromkeys(_NAMES[count], str(pixels.dtype))
    with TemporaryDirectory(prefix="illum-") as folder:
        path = Path(folder) / "image.png"
        file = PngFile(path, width, height, channels, {}, srgb)
        file.write(pixels)
        file.close()
        return path.read_bytes()
