"""Images written by bands from the top, whole or not at all: EXR by OpenImageIO, PNG by its own module."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.color import refuse_nonfinite
from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import AtomicFile, refusals
from illumcli.images.png import PngFile
from illumcli.records import Value

LARGEST_HALF = 65504.0
ChannelType: TypeAlias = Literal["half", "float", "uint", "uint8", "uint16"]
Metadata: TypeAlias = Mapping[str, Any]

_DTYPES = {"half": np.float16, "uint8": np.uint8, "uint16": np.uint16}
_KINDS = {".exr": ("openexr", {"half", "float", "uint"}), ".png": ("png", {"uint8", "uint16"})}


def bits_of(numbers: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Whole numbers as bands of an EXR hold them: the same bits, called floats, which nothing counts with."""
    return np.ascontiguousarray(numbers).view(np.float32)


def numbers_of(bits: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The whole numbers that `bits_of` was given."""
    return np.ascontiguousarray(bits).view(np.uint32)


def channel_types(names: Sequence[str], colour: Literal["half", "float"] = "half") -> dict[str, ChannelType]:
    """Channel name -> its type in an EXR: `colour` for R G B A of any layer, float for all other data."""
    return {name: colour if name.rpartition(".")[2] in tuple("RGBA") else "float" for name in names}


class Refused(Exception):
    """An image file cannot be written; the text says why."""


class Written(Value):
    """An image that is on disk under its name."""

    path: Path
    bytes: int
    clamped: int  # values beyond the largest half, 65504, written as +-65504


class ImageWriter:
    """Writes one image from top to bottom, holding no more of it than the band at hand.

    An image counts as written only when what is read back from the part file is what was handed over.

    Parameters
    ----------
    path
        Ends in `.exr` or `.png`.
    channels : mapping of name to type, in the order of the bands' last axis
        EXR: half, float or uint, which are whole numbers of 32 bits, any names. PNG: uint8 or uint16, one
        type, named Y, Y A, R G B or R G B A.
    metadata : mapping of name to number, text or tuple of them
        EXR keeps integers of 32 bits, floats in single precision, texts and tuples of one kind; larger
        integers become text. PNG keeps text alone.
    srgb : bool
        Whether a PNG holds display values, and says so; else plain numbers.

    Raises
    ------
    InputError
        Another suffix.
    OutputError
        Here, in `write_band` and in `close`: the file cannot be written. No part of it stays behind.
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
        self._named = os.fspath(path)
        suffix = Path(path).suffix.lower()
        if suffix not in _KINDS:
            raise InputError(f"{self._named}: images are written as .exr or .png; choose one of these")
        kind, allowed = _KINDS[suffix]
        if not set(channels.values()) <= allowed or min(width, height) < 1:
            raise ValueError(f"{self._named}: no {width} x {height} {kind} image of {dict(channels)}")
        self._width, self._height = width, height
        self._channels = dict(channels)
        self._halves = [c for c, kind in enumerate(self._channels.values()) if kind == "half"]
        self._light = [c for c, kind in enumerate(self._channels.values()) if kind != "uint"]
        kinds = set(self._channels.values())
        # as written and read back
        self._dtype: Any = _DTYPES.get(kinds.pop(), np.float32) if len(kinds) == 1 else np.float32
        self._rows = 0
        self._clamped = 0
        self._written: Written | None = None
        self._file: Any = None  # a PngFile or an ExrFile, once it is open
        if no_utf8(os.path.realpath(path)):
            raise InputError(f"{shown(os.path.realpath(path))}: {NO_UTF8}")
        open_file = _format(suffix, srgb)
        self._part = AtomicFile(path)
        with self._or_nothing():
            self._file = open_file(self._part.path, width, height, self._channels, metadata or {})

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
            raise ValueError(f"{self._named}: a band {band.shape} at row {y0}, after {self._rows} rows")
        if band.dtype.kind == "f":
            counted = band if len(self._light) == len(self._channels) else band[..., self._light]
            refuse_nonfinite(counted, [list(self._channels)[c] for c in self._light], self._named, y0)
        with self._or_nothing():
            self._file.write(self._stored(band))
        self._rows = y1

    def close(self) -> Written:
        """Finish the file, read it back, give it its name; what was written."""
        if self._written is not None:
            return self._written
        with self._or_nothing():
            if self._rows != self._height:
                raise ValueError(f"{self._named}: closed after {self._rows} of {self._height} rows")
            self._file.close()
            self._compare()
            size = self._part.path.stat().st_size
            self._part.commit()
        self._written = Written(Path(self._named), size, self._clamped)
        return self._written

    def discard(self) -> None:
        """Remove what was written so far."""
        if self._file is not None:
            self._file.abandon()
        self._part.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self.discard()

    def _stored(self, band: NDArray[Any]) -> NDArray[Any]:
        """(h, W, C) the values the file will hold."""
        if not self._halves:
            if band.dtype != self._dtype:
                raise ValueError(f"{self._named}: a band of {band.dtype}, not {self._dtype.__name__}")
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

    def _compare(self) -> None:
        if not self._file.is_as_written():
            raise Refused("what was read back differs from what was written")

    @contextmanager
    def _or_nothing(self) -> Iterator[None]:
        """Whatever goes wrong, no part stays behind; what the file refuses is an OutputError."""
        try:
            with refusals(self._named):
                yield
        except BaseException as error:
            self.discard()
            if isinstance(error, Refused):
                fact = " ".join(str(error).split())
                way = "free space or change the folder"
                raise OutputError(f"{self._named}: cannot be written: {fact}; {way}") from error
            raise


def _format(suffix: str, srgb: bool) -> Any:
    """What writes such files; loaded before a part exists, for a signal meanwhile may end the process."""
    if suffix == ".png":
        return partial(PngFile, srgb=srgb)
    from illumcli.images.oiio import ExrFile  # OpenImageIO loads as long as a small picture takes

    return ExrFile


NO_UTF8 = "the path is not UTF-8, which image files need; rename the file or its folder"


def no_utf8(path: str) -> bool:
    """Does the path hold bytes that are not UTF-8?"""
    return any("\udc80" <= c <= "\udcff" for c in path)


def shown(path: str) -> str:
    """The path with such bytes as \\xNN."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
