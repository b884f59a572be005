"""Images of any format that OpenImageIO reads: pixels, metadata, textures."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from illumcli.color import Space, Texels, from_srgb
from illumcli.errors import InputError, OutputError
from illumcli.film.channels import bits_of, numbers_of
from illumcli.images.names import NO_UTF8, no_utf8, printable
from illumcli.images.openimageio import oiio
from illumcli.memory import refuse_beyond
from illumcli.records import Record

READ_ROWS = 64  # rows held at once while reading in bands
PLANE_BYTES = 6  # of each channel of a pixel while an image is read

_SIGNATURES = {b"\x89PNG": ".png", b"\xff\xd8": ".jpg", b"RIFF": ".webp"}
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


class Image(Record):
    """An image with the values of its file."""

    width: int
    height: int
    channels: dict[str, NDArray[Any]]
    """By name (`R`, `Z`, `P.X`), (H, W) float32, integers as 0..1; uint32 for integer channels of an EXR."""
    encoded: bool  # True for display values, which files hold as integers; False for linear light
    metadata: dict[str, Any]


def read_image(path: str | os.PathLike[str]) -> Image:
    """The image in a file of any format OpenImageIO reads.

    Raises
    ------
    InputError
        The file does not exist, is no image, is damaged or truncated, or has several parts.
    """
    with ImageSource(Path(path)) as source:
        source.refuse_large(PLANE_BYTES)
        height, width = source.height, source.width
        planes = np.empty((len(source.names), height, width), np.float32)
        y = 0
        for band in source.bands(np.float32):
            planes[:, y : y + len(band)] = np.moveaxis(band, -1, 0)
            y += len(band)
        channels: dict[str, NDArray[Any]] = dict(zip(source.names, planes, strict=True))
        channels |= {source.names[c]: numbers_of(planes[c]) for c in source.numbers}
        return Image(width, height, channels, source.encoded, source.metadata())


def read_metadata(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The attributes in the header of an image, by name; no pixel is read.

    Raises
    ------
    InputError
        No such file, or no image.
    """
    with ImageSource(Path(path)) as source:
        return source.metadata()


def texture_bytes(path: Path) -> int:
    """Bytes of the texture at `path` in memory. Reads the header alone, and only once until the file changes.

    Raises
    ------
    InputError
        No such file, or no image.
    """
    try:
        facts = path.stat()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    return _texture_bytes(path, facts.st_mtime_ns, facts.st_size)


@lru_cache(maxsize=256)
def _texture_bytes(path: Path, modified: int, length: int) -> int:
    with ImageSource(path) as source:
        return source.texel_count * _stored_type(source).itemsize


def read_texture(path: str | os.PathLike[str], space: Space = None) -> Texels:
    """The image with linear values; integers of 8 and 16 bits are kept, with a table that decodes them.

    Parameters
    ----------
    space
        `srgb`: decoded by the sRGB curve, except alpha. `linear`: values as stored, integers as 0..1.
        By default `linear` for floats and `srgb` for integers.

    Raises
    ------
    InputError
        As of `read_image`, or values are NaN or infinite.
    """
    with ImageSource(Path(path)) as source:
        # Make room in the type of the file's values, and find the channels that have the sRGB curve.
        stored = _stored_type(source)
        source.refuse_large(stored.itemsize + 1)
        colours = [c for c, name in enumerate(source.names) if name.rpartition(".")[2] != "A"]
        is_curved = (space or ("srgb" if source.encoded else "linear")) == "srgb"
        texels = np.empty((source.height, source.width, len(source.names)), stored)
        y = invalid = 0

        # Read band by band; decode floats.
        for band in source.bands(stored.type):
            rows = texels[y : y + len(band)]
            rows[:] = band
            y += len(band)
            if stored.kind == "u":
                continue
            for c in source.numbers:
                rows[..., c] = numbers_of(rows[..., c])
            invalid += int(np.count_nonzero(~np.isfinite(rows).all(axis=-1)))
            if is_curved:
                rows[..., colours] = from_srgb(rows[..., colours])
    if invalid:
        raise InputError(f"{os.fspath(path)}: {invalid} texels are NaN or infinite; mend the texture")

    # Integers get a table per channel that decodes them.
    channels = tuple(range(texels.shape[2]))
    if stored.kind != "u":
        return Texels(texels, channels)
    largest = np.iinfo(stored).max
    steps = np.arange(largest + 1) / largest
    tables = np.tile(steps.astype(np.float32), (len(channels), 1))
    if is_curved:
        tables[colours] = from_srgb(steps).astype(np.float32)
    return Texels(texels, channels, tables)


def _stored_type(source: ImageSource) -> np.dtype[Any]:
    """The type that the texels of an image have in memory."""
    return source.dtype if source.dtype in (np.uint8, np.uint16) else np.dtype(np.float32)


def read_embedded_texture(data: bytes, name: str, space: Space) -> Texels:
    """`read_texture` of an image inside another file; messages call it `name`.

    OpenImageIO reads only files, so the image is written to a temporary one.
    """
    suffix = next((suffix for start, suffix in _SIGNATURES.items() if data.startswith(start)), "")
    try:
        with NamedTemporaryFile(prefix="illum-", suffix=suffix) as file:
            file.write(data)
            file.flush()
            return read_texture(file.name, space)
    except OSError as error:
        raise OutputError(f"{name}: no room to unpack it ({error.strerror}); set TMPDIR") from None
    except InputError as error:
        raise InputError([problem.replace(file.name, name) for problem in error.problems]) from None


class ImageSource:
    """An open image file; all errors are InputErrors that name it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            if not path.is_file():
                raise InputError(f"{path}: no such file" if not path.exists() else f"{path}: not a file")
        except (OSError, ValueError) as error:  # a name that no file can have
            name = f"{path}" if len(f"{path}") <= 80 else f"{str(path)[:80]}..."
            raise InputError(f"{name}: {getattr(error, 'strerror', None) or error}; check the name") from None
        if no_utf8(os.fspath(path)):
            raise InputError(f"{printable(os.fspath(path))}: {NO_UTF8}")
        raw = oiio.ImageSpec()
        raw.attribute("oiio:UnassociatedAlpha", 1)  # values as the file has them
        opened = oiio.ImageInput.open(os.fspath(path), raw)
        if opened is None:
            raise self._refusal(oiio.geterror())
        self._input, self._spec = opened, opened.spec()
        self._format = opened.format_name()
        if self._format == "openexr" and self._spec.get_int_attribute("oiio:subimages", 1) > 1:
            raise InputError(f"{path}: an EXR of several parts; join them (oiiotool IN --siappendall -o OUT)")
        if self._format == "png":
            try:
                is_complete = _ends_with(path, _PNG_END)
            except OSError as error:
                raise self._refusal(error.strerror or str(error)) from error
            if not is_complete:
                raise self._refusal("its end is missing")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._input.close()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._spec.channelnames)

    @property
    def width(self) -> int:
        return int(self._spec.width)

    @property
    def height(self) -> int:
        return int(self._spec.height)

    @property
    def texel_count(self) -> int:
        """Pixels times channels."""
        return self.width * self.height * int(self._spec.nchannels)

    def refuse_large(self, each: int) -> None:
        """Raise LimitError if the image does not fit into memory with `each` bytes per channel of a pixel."""
        what = f"{self._path}: {self.width} x {self.height} pixels"
        refuse_beyond(each * self.texel_count, what, "make it smaller")

    @property
    def dtype(self) -> np.dtype[Any]:
        """The file's own type, the widest of its channels."""
        name = str(self._spec.format)
        return np.dtype(
            {"half": "float16", "float": "float32", "uint": "uint32", "int": "int32"}.get(name, name)
        )

    @property
    def numbers(self) -> list[int]:
        """Indices of the channels that hold integers of an EXR, which are no display values."""
        formats = self._spec.channelformats or [self._spec.format] * self._spec.nchannels
        return [c for c, kind in enumerate(formats) if self._format == "openexr" and kind == oiio.UINT]

    @property
    def encoded(self) -> bool:
        return self.dtype.kind in "iu" and self._format != "openexr"

    def order(self, names: tuple[str, ...]) -> list[int] | None:
        """The index of each of `names` among the file's channels; None if the order is the same."""
        if sorted(names) != sorted(self.names):
            raise self._refusal(f"it holds the channels {self.names}")
        return None if names == self.names else [self.names.index(name) for name in names]

    def bands(self, dtype: type[Any]) -> Iterator[NDArray[Any]]:
        """(h, W, C) `dtype`, the image in bands from the top; integers of an EXR as bits of float32."""
        spec = self._spec
        kind = {np.float16: oiio.HALF, np.uint8: oiio.UINT8, np.uint16: oiio.UINT16}.get(dtype, oiio.FLOAT)
        top, bottom, rows = spec.y, spec.y + spec.height, spec.tile_height or READ_ROWS
        for y0 in range(top, bottom, rows):
            y1 = min(y0 + rows, bottom)
            band = self._rows(y0, y1, (0, spec.nchannels), kind)
            for c in self.numbers:
                band[..., c] = bits_of(self._rows(y0, y1, (c, c + 1), oiio.UINT))[..., 0]
            yield band

    def _rows(self, y0: int, y1: int, channels: tuple[int, int], kind: oiio.BASETYPE) -> NDArray[Any]:
        """(h, W, channels) rows of some channels, from the first to before the last."""
        spec = self._spec
        if spec.tile_height:
            columns = (spec.x, spec.x + spec.width)
            band = self._input.read_tiles(0, 0, *columns, y0, y1, 0, 1, *channels, kind)
        else:
            band = self._input.read_scanlines(0, 0, y0, y1, 0, *channels, kind)
        message = self._input.geterror()  # errors in a JPEG show in the message alone
        if band is None or message:
            raise self._refusal(message)
        return band.reshape(y1 - y0, spec.width, channels[1] - channels[0])

    def metadata(self) -> dict[str, Any]:
        return {entry.name: _plain(entry.value) for entry in self._spec.extra_attribs}

    def _refusal(self, message: str) -> InputError:
        fact = " ".join(message.split()) or "no reason given"
        return InputError(f"{self._path}: cannot be read as an image: {fact}; make or fetch the file again")


def _ends_with(path: Path, tail: bytes) -> bool:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - len(tail)))
        return file.read() == tail


def _plain(value: Any) -> Any:
    """An attribute as a Python value; floats as the shortest decimal of the same single-precision number."""
    if isinstance(value, float):
        return float(str(np.float32(value)))
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value
