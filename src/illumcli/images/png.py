"""PNG files, written row by row from the top with zlib alone.

References
----------
ISO/IEC 15948:2004. Portable Network Graphics (PNG): functional specification.
"""

from __future__ import annotations

import hashlib
import os
import struct
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.files.seal import png_digest, png_end
from illumcli.images.format import RESERVED

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOUR_TYPES = {("Y",): 0, ("R", "G", "B"): 2, ("Y", "A"): 4, ("R", "G", "B", "A"): 6}
_LEVEL = 1  # of 9; renders become a fifth smaller at 6, in five times the time
_FILTER = 1  # differences to the left pixel
_PIECE = 1 << 16  # bytes compressed at once, however high the bands are: zlib's output may depend on it


class PngFile:
    """Writes rows to a PNG file; colour is not premultiplied, values are not converted.

    Parameters
    ----------
    channels : mapping of name to `uint8` or `uint16`
        Y, Y A, R G B or R G B A of one type.
    metadata : mapping of name to number, text or tuple of them
        Kept as text.
    srgb : bool
        True if values are display values, which the file then states. Otherwise they are plain numbers, and
        the file names no transfer curve.

    Raises
    ------
    OSError
        Here and in all methods but `abandon`: the operating system cannot write.
    """

    def __init__(
        self,
        path: Path,
        width: int,
        height: int,
        channels: Mapping[str, str],
        metadata: Mapping[str, Any],
        srgb: bool = True,
    ) -> None:
        self._path = path
        self._dtype = np.dtype(next(iter(channels.values()))).newbyteorder(">")
        self._pixel = len(channels) * self._dtype.itemsize
        self._line = width * self._pixel
        self._deflate = zlib.compressobj(_LEVEL)
        self._waiting = bytearray()
        self._hash = png_digest()
        self._file = path.open("wb")
        self._put(_SIGNATURE)
        bits = 8 * self._dtype.itemsize
        kind = _COLOUR_TYPES[tuple(channels)]
        self._chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0))
        if srgb:
            self._chunk(b"sRGB", b"\0")
            self._chunk(b"gAMA", (45455).to_bytes(4))  # for readers that do not know sRGB
        self._texts: dict[str, str] = {}
        for name, value in metadata.items():
            if value == RESERVED:
                continue
            text = " ".join(map(str, value)) if isinstance(value, tuple) else str(value)
            if text.isascii():
                self._text(name, text)
            else:
                self._chunk(b"iTXt", name.encode("latin-1") + b"\0\0\0\0\0" + text.encode())

    def write(self, band: NDArray[Any]) -> None:
        """Append rows, (h, W, C)."""
        rows = band.astype(self._dtype, copy=False).reshape(len(band), -1).view(np.uint8)
        lines = np.empty((len(band), 1 + self._line), np.uint8)
        lines[:, 0] = _FILTER
        lines[:, 1 : 1 + self._pixel] = rows[:, : self._pixel]
        np.subtract(rows[:, self._pixel :], rows[:, : -self._pixel], out=lines[:, 1 + self._pixel :])
        self._waiting += lines.data
        ready = len(self._waiting) // _PIECE * _PIECE
        for at in range(0, ready, _PIECE):
            self._image(self._deflate.compress(self._waiting[at : at + _PIECE]))
        del self._waiting[:ready]

    def set_text(self, name: str, text: str) -> None:
        """Set a text of the metadata whose room is `RESERVED`; it stands behind the pixels."""
        self._texts[name] = text

    def close(self) -> None:
        """Finish the file."""
        self._image(self._deflate.compress(self._waiting) + self._deflate.flush())
        for name, text in self._texts.items():
            self._text(name, text)
        self._put(png_end(self._hash))
        self._file.close()

    def is_as_written(self) -> bool:
        """True if the closed file holds the bytes that were written."""
        with self._path.open("rb") as file:
            digest = hashlib.file_digest(file, png_digest)
        return digest.digest() == self._hash.digest()

    def abandon(self) -> None:
        """Close the unfinished file."""
        with suppress(OSError):
            self._file.close()

    def _image(self, packed: bytes) -> None:
        if packed:
            self._chunk(b"IDAT", packed)

    def _text(self, name: str, text: str) -> None:
        self._chunk(b"tEXt", name.encode("latin-1") + b"\0" + text.encode())

    def _chunk(self, kind: bytes, data: bytes) -> None:
        check = zlib.crc32(data, zlib.crc32(kind))
        self._put(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check))

    def _put(self, data: bytes) -> None:
        self._file.write(data)
        self._hash.update(data)


def read_texts(path: Path) -> dict[str, str]:
    """Name -> text of every `tEXt` chunk of a PNG.

    Raises
    ------
    ValueError
        The file is no PNG, or it is truncated.
    """
    texts = {}
    with path.open("rb") as file:
        if file.read(len(_SIGNATURE)) != _SIGNATURE:
            raise ValueError(f"{path}: is no PNG")
        while (head := file.read(8))[4:] != b"IEND":
            if len(head) < 8:
                raise ValueError(f"{path}: its end is missing")
            length = int.from_bytes(head[:4])
            if head[4:] == b"tEXt":
                name, _, text = file.read(length).decode("latin-1").partition("\0")
                texts[name] = text
                length = 0
            file.seek(length + 4, os.SEEK_CUR)  # the checksum ends a chunk
    return texts
