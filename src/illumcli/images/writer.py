"""Writes images in bands from the top, completely or not at all: EXR by OpenImageIO, PNG by `images.png`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import AtomicFile, os_errors_as_output_errors
from illumcli.film.channels import ChannelType, Metadata
from illumcli.film.finite import refuse_nonfinite
from illumcli.images.format import RESERVED, ImageFile, WriteError
from illumcli.images.names import NO_UTF8, no_utf8, printable
from illumcli.images.png import PngFile
from illumcli.records import Value

LARGEST_HALF = 65504.0

_DTYPES = {"half": np.float16, "uint8": np.uint8, "uint16": np.uint16}
_KINDS = {".exr": ("openexr", {"half", "float", "uint"}), ".png": ("png", {"uint8", "uint16"})}


class Written(Value):
    """An image that has been written."""

    path: Path
    bytes: int
    clamped: int  # values beyond the largest half, 65504, written as +-65504


class ImageWriter:
    """Writes one image from top to bottom; only one band is in memory.

    An image counts as written only if its temporary file, read back, holds the values that were written.

    Parameters
    ----------
    path
        Ends in `.exr` or `.png`.
    channels : mapping of name to type, in the order of the bands' last axis
        EXR: half, float or uint, an integer of 32 bits, with any names. PNG: uint8 or uint16, the same for
        all, named Y, Y A, R G B or R G B A.
    metadata : mapping of name to number, text or tuple of them
        EXR keeps integers of 32 bits, floats in single precision, texts and tuples of one kind; larger
        integers become text. PNG keeps text alone.
    srgb : bool
        True if a PNG holds display values, which it then states; otherwise it holds plain numbers.

    Raises
    ------
    InputError
        Another suffix, or a path that is not UTF-8.
    OutputError
        Here, in `write_band` and in `close`: the file cannot be written. The temporary file is removed.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        width: int,
        height: int,
        channels: Mapping[str, ChannelType],
        metadata: Metadata | None = None,
        srgb: bool = True,
    ) -> None:
        self._name = os.fspath(path)
        suffix = Path(path).suffix.lower()
        if suffix not in _KINDS:
            raise InputError(f"{self._name}: images are written as .exr or .png; choose one of these")
        format_name, allowed = _KINDS[suffix]
        if not set(channels.values()) <= allowed or min(width, height) < 1:
            raise ValueError(f"{self._name}: no {width} x {height} {format_name} image of {dict(channels)}")
        self._width, self._height = width, height
        self._channels = dict(channels)
        self._halves = [c for c, kind in enumerate(self._channels.values()) if kind == "half"]
        self._light = [c for c, kind in enumerate(self._channels.values()) if kind != "uint"]

        # The type in which bands are written and read back.
        kinds = set(self._channels.values())
        self._dtype: type[Any] = _DTYPES.get(kinds.pop(), np.float32) if len(kinds) == 1 else np.float32

        self._rows = 0
        self._clamped = 0
        self._written: Written | None = None
        self._file: ImageFile | None = None  # once it is open
        if no_utf8(os.path.realpath(path)):
            raise InputError(f"{printable(os.path.realpath(path))}: {NO_UTF8}")
        open_file = _format(suffix, srgb)
        self._atomic = AtomicFile(path)
        with self._all_or_nothing():
            self._file = open_file(self._atomic.path, width, height, self._channels, metadata or {})

    def write_band(self, y0: int, band: NDArray[Any]) -> None:
        """Write the rows `y0` to ``y0 + h``; bands come in order and without gaps.

        Parameters
        ----------
        band : (h, W, C)
            float32 for EXR, in which the channels of type uint hold the bits of uint32 (`bits_of`); the
            channels' own integers for PNG (`film.encode` makes them).

        Raises
        ------
        IllumError
            NaN or Inf in the band; which channel, how many, where.
        """
        y1 = y0 + len(band)
        if y0 != self._rows or y1 > self._height or band.shape[1:] != (self._width, len(self._channels)):
            raise ValueError(f"{self._name}: a band {band.shape} at row {y0}, after {self._rows} rows")
        if band.dtype.kind == "f":
            counted = band if len(self._light) == len(self._channels) else band[..., self._light]
            refuse_nonfinite(counted, [list(self._channels)[c] for c in self._light], self._name, y0)
        with self._all_or_nothing():
            self._open_file.write(self._stored(band))
        self._rows = y1

    def set_text(self, name: str, text: str) -> None:
        """Set a text of the metadata that was passed as `RESERVED`.

        Parameters
        ----------
        text : str
            In ASCII, of at most `len(RESERVED)` letters.
        """
        if not text.isascii() or len(text) > len(RESERVED):
            raise ValueError(f"{self._name}: {name} has no room for {text!r}")
        self._open_file.set_text(name, text)

    def close(self) -> Written:
        """Finish the file, read it back and give it its name."""
        if self._written is not None:
            return self._written
        with self._all_or_nothing():
            if self._rows != self._height:
                raise ValueError(f"{self._name}: closed after {self._rows} of {self._height} rows")
            file = self._open_file
            file.close()
            if not file.is_as_written():
                raise WriteError("what was read back differs from what was written")
            size = self._atomic.path.stat().st_size
            self._atomic.commit()
        self._written = Written(Path(self._name), size, self._clamped)
        return self._written

    def discard(self) -> None:
        """Remove what was written so far."""
        if self._file is not None:
            self._file.abandon()
        self._atomic.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self.discard()

    @property
    def _open_file(self) -> ImageFile:
        assert self._file is not None
        return self._file

    def _stored(self, band: NDArray[Any]) -> NDArray[Any]:
        """(h, W, C) the values as the file holds them."""
        if not self._halves:
            if band.dtype != self._dtype:
                raise ValueError(f"{self._name}: a band of {band.dtype}, not {self._dtype.__name__}")
            return band
        colour = band[..., self._halves]
        beyond = np.abs(colour) > LARGEST_HALF
        if beyond.any():
            self._clamped += int(np.count_nonzero(beyond))
            colour = np.clip(colour, -LARGEST_HALF, LARGEST_HALF)
        if self._dtype is np.float16:
            return colour.astype(np.float16)
        stored = np.array(band, np.float32, order="C")
        stored[..., self._halves] = colour.astype(np.float16)
        return stored

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        """Remove the temporary file after any error; errors of writing become OutputErrors."""
        try:
            with os_errors_as_output_errors(self._name):
                yield
        except BaseException as error:
            self.discard()
            if isinstance(error, WriteError):
                fact = " ".join(str(error).split())
                advice = "free space or change the folder"
                raise OutputError(f"{self._name}: cannot be written: {fact}; {advice}") from error
            raise


class _OpenFile(Protocol):
    """The class of a format, ready to open a file."""

    def __call__(
        self, path: Path, width: int, height: int, channels: Mapping[str, str], metadata: Metadata
    ) -> ImageFile: ...


def _format(suffix: str, srgb: bool) -> _OpenFile:
    """The class that writes such files; loaded before a temporary file exists, because a signal during the
    import may end the process."""
    if suffix == ".png":
        return partial(PngFile, srgb=srgb)
    from illumcli.images.exr import ExrFile  # OpenImageIO takes as long to load as a small image to render

    return ExrFile
