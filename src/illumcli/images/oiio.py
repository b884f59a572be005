"""Images through OpenImageIO: EXR written, any format read, layers, metadata, textures, FLIP.

OpenImageIO says True for files that a full disk cut short, so an image counts as written only when every
pixel, read back from the part file, hashes to what was handed over. The JPEG and TIFF libraries may end the
process on a full disk: neither is written. A process must not fork once this module has written.
"""

from __future__ import annotations

import hashlib
import os
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from illumcli.color import from_srgb
from illumcli.errors import InputError, OutputError
from illumcli.files.seal import BLANK, seal
from illumcli.images.writer import NO_UTF8, ImageWriter, Refused, bits_of, no_utf8, numbers_of, shown
from illumcli.memory import refuse_beyond, refuse_little
from illumcli.records import Record

refuse_little(1 << 26)  # OpenImageIO takes 46 MB and ends the process where it does not get them
import OpenImageIO as oiio  # noqa: E402

SHEET_CELL = 256  # width of a picture on a contact sheet [pixels]
READ_ROWS = 64  # rows held at once while reading back
PLANE_BYTES, TEXTURE_BYTES = 6, 12  # of each channel of a pixel while an image, or a texture, is read
HEADER = 1 << 24  # bytes in which the channels of a file written here are named

_HINTS: Mapping[str, Any] = {
    # measured on a render of 12 layers: zip at level 1 is as small as at 4 and as fast as none
    "compression": "zip:1",
    # the colour space by the attribute the header keeps: oiio:ColorSpace costs 30 ms to look its name up
    "colorInteropID": "lin_rec709_scene",
    "DateTime": "",  # no time of day: equal renders are equal files
}
# the last: deflate fails for nothing else
_LITTLE_MEMORY = ("OUT_OF_MEMORY", "bad_alloc", "Unable to run compression routine")
_SIGNATURES = {b"\x89PNG": ".png", b"\xff\xd8": ".jpg", b"RIFF": ".webp"}
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


def layers(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Layer -> its channels. `P.X` is of layer `P`; R G B A Y without a layer are `beauty`; `Z` is `Z`."""
    found: dict[str, tuple[str, ...]] = {}
    for name in names:
        layer = name.rpartition(".")[0] or ("beauty" if name in tuple("RGBAY") else name)
        found[layer] = (*found.get(layer, ()), name)
    return found


class ExrFile:
    """Rows to an EXR file of one part.

    Parameters
    ----------
    channels : mapping of name to `half`, `float` or `uint`
    metadata : mapping of name to number, text or tuple of them
        Integers of 32 bits, floats in single precision, texts and tuples of one kind stay what they are;
        larger integers become text.

    Raises
    ------
    Refused
        Here and in `write` and `close`: why the file cannot be written.
    """

    def __init__(
        self, path: Path, width: int, height: int, channels: Mapping[str, str], metadata: Mapping[str, Any]
    ) -> None:
        self._path = path
        self._names = tuple(channels)
        self._hash = hashlib.blake2b(digest_size=32)
        self._dtype: Any = np.float32
        output = oiio.ImageOutput.create("openexr")
        if output is None:
            reason = oiio.geterror()
            if not reason:  # a format that is built in
                raise MemoryError
            raise Refused(f"{reason}; install one that writes .exr")
        self._output = output
        # whole numbers go through the library as floats of the same bits: it would convert them by way of
        # floats of 24 digits; the header is told their type when all is written
        self._numbers = [name for name, kind in channels.items() if kind == "uint"]
        kinds = [oiio.TypeDesc("float" if kind == "uint" else kind) for kind in channels.values()]
        widest = max(kinds, key=lambda kind: kind.size())
        spec = oiio.ImageSpec(width, height, len(kinds), widest)
        spec.channelnames = self._names
        if len(set(map(str, kinds))) > 1:
            spec.channelformats = tuple(kinds)
        for name, value in {**_HINTS, **metadata, "illum:body": BLANK}.items():
            _set(spec, name, value)
        self._rows = 0
        self._check(self._output.open(os.fspath(path), spec))

    def write(self, band: NDArray[Any]) -> None:
        """The next rows, (h, W, C) with the values the file will hold, those of `uint` as bits."""
        band = np.ascontiguousarray(band)
        self._dtype = band.dtype.type
        self._hash.update(band.data)
        self._check(self._output.write_scanlines(self._rows, self._rows + len(band), 0, band))
        self._rows += len(band)

    def close(self) -> None:
        """The end of the file."""
        self._check(self._output.close())
        if self._numbers:
            _call_numbers(self._path, self._numbers)
        seal(self._path)

    def is_as_written(self) -> bool:
        """Does the closed file hold the pixels it was given? It is read back in bands."""
        found = hashlib.blake2b(digest_size=32)
        try:
            with _Source(self._path) as source:
                order = source.order(self._names)
                for band in source.bands(self._dtype):
                    found.update(np.ascontiguousarray(band if order is None else band[..., order]).data)
        except InputError as error:
            raise Refused(f"what was written cannot be read back ({error})") from error
        return found.digest() == self._hash.digest()

    def abandon(self) -> None:
        """Close the file as it is."""
        self._output.close()

    def _check(self, success: bool) -> None:
        """Neither the answer nor the message alone can be trusted to tell of a failure."""
        message = self._output.geterror()
        if not success or message:
            if any(fact in message for fact in _LITTLE_MEMORY):
                raise MemoryError
            raise Refused(message or "no reason given")


def _call_numbers(path: Path, names: Sequence[str]) -> None:
    """Change the type of channels in the header of an EXR from float to whole numbers of 32 bits.

    The file holds the same bytes for both. A header is a list of name, type, size and value; the value of
    `channels` is one of name, type, four bytes, and the steps of sampling (OpenEXR file layout, openexr.com).
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


class Image(Record):
    """An image as its file has it."""

    width: int
    height: int
    channels: dict[str, NDArray[Any]]
    """By name (`R`, `Z`, `P.X`), (H, W) float32, integers as 0..1; uint32 where an EXR has whole numbers."""
    encoded: bool  # integers, which stand for display values; else linear
    metadata: dict[str, Any]


def read_image(path: str | os.PathLike[str]) -> Image:
    """The image in a file of any format OpenImageIO reads.

    Raises
    ------
    InputError
        No such file, no image, damaged, cut short, or of several parts.
    """
    with _Source(Path(path)) as source:
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
    with _Source(Path(path)) as source:
        return source.metadata()


def texel_count(path: Path) -> int:
    """Numbers in the image at `path`, by its header alone, which is read once while the file stays the same.

    Raises
    ------
    InputError
        No such file, or no image.
    """
    try:
        facts = path.stat()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    return _texel_count(path, facts.st_mtime_ns, facts.st_size)


@lru_cache(maxsize=256)
def _texel_count(path: Path, modified: int, length: int) -> int:
    with _Source(path) as source:
        return source.texel_count


def read_texture(
    path: str | os.PathLike[str], space: Literal["srgb", "linear"] | None = None
) -> NDArray[np.float32]:
    """(H, W, C) float32, linear; the first row is the top of the image.

    Parameters
    ----------
    space
        `srgb`: decoded by the sRGB curve, alpha excepted. `linear`: values as stored, integers as 0..1.
        By default the pixels' own type says: `linear` for floats, `srgb` for integers.

    Raises
    ------
    InputError
        As `read_image`; NaN or Inf.
    """
    with _Source(Path(path)) as source:
        source.refuse_large(TEXTURE_BYTES)
        colours = [c for c, name in enumerate(source.names) if name.rpartition(".")[2] != "A"]
        small = source.dtype == np.uint8
        space = space or ("srgb" if source.encoded else "linear")
        texels = np.concatenate(list(source.bands(np.uint8 if small else np.float32)))
        for c in source.numbers:
            texels[..., c] = numbers_of(texels[..., c])
    steps = np.arange(256) / 255
    if small:
        straight, curved = steps.astype(np.float32), from_srgb(steps).astype(np.float32)
        linear = straight[texels]
        if space == "srgb":
            linear[..., colours] = curved[texels[..., colours]]
        return linear
    if not np.isfinite(texels).all():
        count = int(np.count_nonzero(~np.isfinite(texels).all(axis=-1)))
        raise InputError(f"{os.fspath(path)}: {count} texels are NaN or infinite; mend the texture")
    if space == "srgb":
        texels[..., colours] = from_srgb(texels[..., colours])
    return texels


def read_embedded_texture(
    data: bytes, name: str, space: Literal["srgb", "linear"] | None
) -> NDArray[np.float32]:
    """`read_texture` of an image that lies within another file; `name` is what it is called in messages.

    OpenImageIO reads files alone: the image stands in a temporary one meanwhile.
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


def flip(
    reference: NDArray[np.float32], test: NDArray[np.float32], encoded: bool = False
) -> tuple[float, NDArray[np.float32]]:
    """Mean FLIP error and its (H, W) map: 0 where an observer sees no difference, up to 1.

    Andersson et al. (2020), FLIP: A difference evaluator for alternating images; for linear light the
    largest over exposures as in Andersson et al. (2021), Visualizing errors in rendered high dynamic range
    images. The exposures are those of a median of 0.18 and a maximum of 2, whatever the image, so that
    figures of different images compare. The observer sits 0.7 m from a 0.7 m wide screen of 3840 pixels.

    Parameters
    ----------
    reference, test : (H, W, 3) float32, finite
        Linear light, or display values (sRGB, 0..1) when `encoded`.
    """
    a, b = (_buffer(from_srgb(np.clip(each, 0, 1)) if encoded else each) for each in (reference, test))
    found = oiio.ImageBufAlgo.FLIP_diff(a, b, hdr=0 if encoded else 1)
    if found.has_error:
        raise RuntimeError(found.geterror())
    errors = np.asarray(found.get_pixels(oiio.FLOAT))[..., 0]
    return float(errors.mean(dtype=np.float64)), errors


def write_sheet(
    path: str | os.PathLike[str], pictures: Iterable[NDArray[np.uint8]], labels: Sequence[str], content: str
) -> None:
    """Write a contact sheet as PNG: pictures row by row, each scaled to a cell, its label below.

    Parameters
    ----------
    pictures : iterable of (H, W, 1 or 3) uint8
        Display values; taken one at a time.
    labels : sequence of str
        As many.
    content : str
        Hash of all that the sheet shows; the file says it.
    """
    side, gap, text = SHEET_CELL, 8, 14
    columns = max(1, min(len(labels), round((len(labels) * 1.6) ** 0.5)))
    cells: list[NDArray[np.uint8]] = []
    for picture, label in zip(pictures, labels, strict=True):
        height = max(1, round(side * picture.shape[0] / picture.shape[1]))
        source = _display(np.repeat(picture, 3, axis=2) if picture.shape[2] == 1 else picture)
        small = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, side, 0, height, 0, 1, 0, 3))
        cell = _display(np.full((height + 2 * gap + text, side + gap, 3), 255, np.uint8))
        oiio.ImageBufAlgo.paste(cell, gap // 2, gap // 2, 0, 0, small)
        fitting = label if len(label) <= side // 8 else f"{label[: side // 8 - 1]}…"
        oiio.ImageBufAlgo.render_text(cell, gap // 2, height + gap + text, fitting, text, "", (0.0, 0.0, 0.0))
        cells.append(np.asarray(cell.get_pixels(oiio.UINT8)))
    tall = max(len(cell) for cell in cells)
    blank = np.full((tall, side + gap, 3), 255, np.uint8)
    cells = [np.concatenate([cell, blank[len(cell) :]]) for cell in cells]
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[k : k + columns], axis=1) for k in range(0, len(cells), columns)]
    whole = np.concatenate(rows)
    about = {"illum:content": content}
    with ImageWriter(path, whole.shape[1], whole.shape[0], dict.fromkeys("RGB", "uint8"), about) as writer:
        writer.write_band(0, whole)


def _display(pixels: NDArray[np.uint8]) -> oiio.ImageBuf:
    """A buffer of (H, W, 3) display values, for arithmetic on them as they are."""
    buffer = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8))
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels))
    return buffer


def _buffer(pixels: NDArray[Any]) -> oiio.ImageBuf:
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT)
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels, np.float32))
    return buffer


class _Source:
    """An open image file; every refusal is an InputError that names it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            if not path.is_file():
                raise InputError(f"{path}: no such file" if not path.exists() else f"{path}: not a file")
        except (OSError, ValueError) as error:  # a name that no file can have
            name = f"{path}" if len(f"{path}") <= 80 else f"{str(path)[:80]}..."
            raise InputError(f"{name}: {getattr(error, 'strerror', None) or error}; check the name") from None
        if no_utf8(os.fspath(path)):
            raise InputError(f"{shown(os.fspath(path))}: {NO_UTF8}")
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
                whole = _ends_with(path, _PNG_END)
            except OSError as error:
                raise self._refusal(error.strerror or str(error)) from error
            if not whole:
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
        """Raise LimitError where the image, `each` bytes a channel of a pixel, does not fit into memory."""
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
        """The channels that hold whole numbers, which only EXR has."""
        formats = self._spec.channelformats or [self._spec.format] * self._spec.nchannels
        return [c for c, kind in enumerate(formats) if self._format == "openexr" and kind == oiio.UINT]

    @property
    def encoded(self) -> bool:
        return self.dtype.kind in "iu" and self._format != "openexr"

    def order(self, names: tuple[str, ...]) -> list[int] | None:
        """Where each of `names` is among the file's channels; None where the file has that very order."""
        if sorted(names) != sorted(self.names):
            raise self._refusal(f"it holds the channels {self.names}")
        return None if names == self.names else [self.names.index(name) for name in names]

    def bands(self, dtype: Any) -> Iterator[NDArray[Any]]:
        """(h, W, C) `dtype`, the whole image from the top; whole numbers of an EXR as bits of float32."""
        spec = self._spec
        kind = {np.float16: oiio.HALF, np.uint8: oiio.UINT8, np.uint16: oiio.UINT16}.get(dtype, oiio.FLOAT)
        top, bottom, rows = spec.y, spec.y + spec.height, spec.tile_height or READ_ROWS
        for y0 in range(top, bottom, rows):
            y1 = min(y0 + rows, bottom)
            band = self._rows(y0, y1, (0, spec.nchannels), kind)
            for c in self.numbers:
                band[..., c] = bits_of(self._rows(y0, y1, (c, c + 1), oiio.UINT))[..., 0]
            yield band

    def _rows(self, y0: int, y1: int, channels: tuple[int, int], kind: Any) -> NDArray[Any]:
        """(h, W, channels) rows of some channels, from the first to before the last."""
        spec = self._spec
        if spec.tile_height:
            columns = (spec.x, spec.x + spec.width)
            band = self._input.read_tiles(0, 0, *columns, y0, y1, 0, 1, *channels, kind)
        else:
            band = self._input.read_scanlines(0, 0, y0, y1, 0, *channels, kind)
        message = self._input.geterror()  # for JPEG the message alone tells
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


def _set(spec: oiio.ImageSpec, name: str, value: Any) -> None:
    """Give `spec` an attribute in a type that EXR keeps."""
    if isinstance(value, str):
        spec.attribute(name, value)
    elif isinstance(value, tuple):
        kind = "string" if isinstance(value[0], str) else "int" if isinstance(value[0], int) else "float"
        spec.attribute(name, oiio.TypeDesc(f"{kind}[{len(value)}]"), value)
    elif isinstance(value, int):
        spec.attribute(name, int(value) if -(2**31) <= value < 2**31 else str(value))
    else:
        spec.attribute(name, float(value))


def _plain(value: Any) -> Any:
    """An attribute as Python has it; floats as the shortest decimal that names the same single."""
    if isinstance(value, float):
        return float(str(np.float32(value)))
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value
