"""EXR files, written through OpenImageIO and read back.

OpenImageIO reports success for files that a full disk truncated, so an image counts as written only if the
pixels read back from the temporary file have the checksum of those written. The JPEG and TIFF libraries may
end the process on a full disk: neither format is written. A process must not fork once this module has
written.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.files.seal import BLANK, seal
from illumcli.film.channels import Metadata
from illumcli.images.format import RESERVED, WriteError
from illumcli.images.openimageio import oiio
from illumcli.images.reader import ImageSource

HEADER = 1 << 24  # the channels of a file written here are named within so many bytes

_HINTS: Metadata = {
    # measured on a render of 12 layers: zip at level 1 is as small as at 4 and as fast as none
    "compression": "zip:1",
    # the colour space as the header's own attribute: looking up oiio:ColorSpace takes 30 ms
    "colorInteropID": "lin_rec709_scene",
    "DateTime": "",  # no time of day: equal renders are equal files
}
# the last one: deflate fails for no other reason
_LITTLE_MEMORY = ("OUT_OF_MEMORY", "bad_alloc", "Unable to run compression routine")


class ExrFile:
    """Writes rows to an EXR file of one part.

    Parameters
    ----------
    channels : mapping of name to `half`, `float` or `uint`
    metadata : mapping of name to number, text or tuple of them
        Integers of 32 bits, floats in single precision, texts and tuples of one kind keep their types; larger
        integers become text.

    Raises
    ------
    WriteError
        Here and in `write` and `close`: why the file cannot be written.
    """

    def __init__(
        self, path: Path, width: int, height: int, channels: Mapping[str, str], metadata: Metadata
    ) -> None:
        self._path = path
        self._names = tuple(channels)
        self._checksum = 0
        self._dtype: type[np.generic] = np.float32
        output = oiio.ImageOutput.create("openexr")
        if output is None:
            reason = oiio.geterror()
            if not reason:  # a format that is built in
                raise MemoryError
            raise WriteError(f"{reason}; install one that writes .exr")
        self._output = output

        # Integers are passed to the library as floats of the same bits, because it would round them to 24
        # bits. Their type is set in the header when the file is closed.
        self._numbers = [name for name, kind in channels.items() if kind == "uint"]
        kinds = [oiio.TypeDesc("float" if kind == "uint" else kind) for kind in channels.values()]

        widest = max(kinds, key=lambda kind: kind.size())
        spec = oiio.ImageSpec(width, height, len(kinds), widest)
        spec.channelnames = self._names
        if len(set(map(str, kinds))) > 1:
            spec.channelformats = tuple(kinds)
        for name, value in {**_HINTS, **metadata, "illum:body": BLANK}.items():
            _set_attribute(spec, name, value)
        self._texts: dict[str, str] = {}
        self._rows = 0
        self._check(self._output.open(os.fspath(path), spec))

    def write(self, band: NDArray[Any]) -> None:
        """Append rows, (h, W, C) with the values of the file, those of `uint` as the bits of floats."""
        band = np.ascontiguousarray(band)
        self._dtype = band.dtype.type
        self._checksum = zlib.crc32(band.data, self._checksum)
        self._check(self._output.write_scanlines(self._rows, self._rows + len(band), 0, band))
        self._rows += len(band)

    def set_text(self, name: str, text: str) -> None:
        """Set a text of the metadata whose room is `RESERVED`."""
        self._texts[name] = text

    def close(self) -> None:
        """Finish the file."""
        self._check(self._output.close())
        if self._numbers:
            _retype_as_integers(self._path, self._numbers)
        if self._texts:
            _fill_reserved(self._path, self._texts)
        seal(self._path)

    def is_as_written(self) -> bool:
        """True if the closed file holds the pixels that were written; reads it back in bands."""
        checksum = 0
        try:
            with ImageSource(self._path) as source:
                order = source.order(self._names)
                for band in source.bands(self._dtype):
                    pixels = np.ascontiguousarray(band if order is None else band[..., order])
                    checksum = zlib.crc32(pixels.data, checksum)
        except InputError as error:
            raise WriteError(f"what was written cannot be read back ({error})") from error
        return checksum == self._checksum

    def abandon(self) -> None:
        """Close the unfinished file."""
        self._output.close()

    def _check(self, success: bool) -> None:
        """Raise if the library failed, by its result or by its message: either may be missing."""
        message = self._output.geterror()
        if not success or message:
            if any(fact in message for fact in _LITTLE_MEMORY):
                raise MemoryError
            raise WriteError(message or "no reason given")


def _retype_as_integers(path: Path, names: Sequence[str]) -> None:
    """Change the type of channels in the header of an EXR from float to integers of 32 bits.

    Their pixels have the same bytes. A header is a list of name, type, size and value; the value of
    `channels` is a list of name, type, four bytes and the sampling steps (OpenEXR file layout, openexr.com).
    """
    with path.open("r+b") as file:
        header = bytearray(file.read(HEADER))
        at = header.index(b"channels\0chlist\0") + len(b"channels\0chlist\0") + 4
        while header[at]:
            name = bytes(header[at : header.index(0, at)]).decode()
            at += len(name.encode()) + 1
            if name in names:
                file.seek(at)
                file.write(struct.pack("<i", 0))
            at += 16


def _fill_reserved(path: Path, texts: Mapping[str, str]) -> None:
    """Write texts over `RESERVED` in the header of an EXR; blanks remain behind them."""
    with path.open("r+b") as file:
        header = file.read(HEADER)
        for name, text in texts.items():
            start = name.encode() + b"\0string\0" + struct.pack("<i", len(RESERVED))
            file.seek(header.index(start + RESERVED.encode()) + len(start))
            file.write(text.encode("ascii").ljust(len(RESERVED)))


def _set_attribute(spec: oiio.ImageSpec, name: str, value: Any) -> None:
    """Set an attribute of `spec`, in a type that EXR keeps."""
    if isinstance(value, str):
        spec.attribute(name, value)
    elif isinstance(value, tuple):
        kind = "string" if isinstance(value[0], str) else "int" if isinstance(value[0], int) else "float"
        spec.attribute(name, oiio.TypeDesc(f"{kind}[{len(value)}]"), value)
    elif isinstance(value, int):
        spec.attribute(name, int(value) if -(2**31) <= value < 2**31 else str(value))
    else:
        spec.attribute(name, float(value))
