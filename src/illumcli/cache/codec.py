"""Encoding of stored buffers: those of a view sample by sample, those of the scene as JSON and arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, take_or_all
from illumcli.cache.entry import Stored
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.instances import Instances
from illumcli.geometry.mesh import Mesh, Substitute
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.repairs import MeshRepairs, Repair
from illumcli.geometry.scene_geometry import CornerVectors, PlacedMesh, SceneGeometry
from illumcli.graph import Buffers
from illumcli.rays.interaction import Hits
from illumcli.records import Record, Value
from illumcli.render_space import RenderSpace
from illumcli.shading.materials import Numbering
from illumcli.shading.rates import Identity, ShadingPoints
from illumcli.visibility.object_pixels import FittedPixels

CLASSES = {
    cls.__name__: cls
    for cls in (
        Mesh,
        ObjectBounds,
        PlanarPolygons,
        SceneGeometry,
        PlacedMesh,
        Instances,
        RenderSpace,
        CornerVectors,
        MeshRepairs,
        Repair,
        Numbering,
        Substitute,
        FittedPixels,
    )
}
"""Classes of the records in buffers of the scene."""


class Misfit(Exception):
    """A valid entry does not hold a buffer of the expected type and shape."""


# --- buffers of a view, tile by tile --------------------------------------------------------------------


class BufferCodec(Value):
    """The encoding of a tile buffer with one or several values per sample."""

    dtype: type[np.generic]
    planes: int
    pack: Callable[[Any, Buffers], NDArray[Any] | None]
    """Buffer, all buffers of the tile -> (planes, M) at the hits; None if it cannot be stored."""
    unpack: Callable[[NDArray[Any], Hits], Any]
    """(planes, M) and the hits -> buffer."""
    of_pixels: bool = False
    """True if it has a value for every pixel, hit or not: (planes, P) instead of (planes, M)."""

    def layout(self, view: View) -> tuple[tuple[int, ...], type[np.generic]]:
        """Shape and type of the array stored for a view; truth values take a bit each."""
        row = view.width * (1 if self.of_pixels else view.samples)
        if self.dtype is np.bool_:
            return (view.height, self.planes, -(-row // 8)), np.uint8
        return (view.height, self.planes, row), self.dtype


def _pack_hits(hits: Hits, buffers: Buffers) -> NDArray[np.int32]:
    return np.stack([hits.objects, hits.triangle, hits.u.view(np.int32), hits.v.view(np.int32)])


def _pack_points(points: ShadingPoints, buffers: Buffers) -> NDArray[np.float32] | None:
    if not points.are_samples:
        return None
    return np.concatenate([points.position.T, points.n.T])


def _unpack_points(planes: NDArray[np.float32], hits: Hits) -> ShadingPoints:
    places = hits.objects, hits.triangle, hits.u, hits.v
    return ShadingPoints(*places, planes[:3].T, planes[3:].T, Identity())


def _pack_material(material: NDArray[np.int32], buffers: Buffers) -> NDArray[np.uint16] | None:
    if not buffers["points"].are_samples or material.max(initial=0) >= 1 << 16:
        return None
    return material[None].astype(np.uint16)


def _first(planes: NDArray[Any], hits: Hits) -> Any:
    return planes[0]


CODECS = {
    "hits": BufferCodec(np.int32, 4, _pack_hits, lambda planes, hits: hits),
    "points": BufferCodec(np.float32, 6, _pack_points, _unpack_points),
    "material": BufferCodec(np.uint16, 1, _pack_material, lambda planes, hits: planes[0].astype(np.int32)),
    "obscurance": BufferCodec(np.float32, 1, lambda w, buffers: w[None], _first),
    "shadow": BufferCodec(
        np.bool_, 1, lambda delta, buffers: delta[None] != 0, lambda planes, hits: planes[0].astype(F)
    ),
    "edges": BufferCodec(np.bool_, 1, lambda edges, buffers: edges[None], _first, of_pixels=True),
}
"""Tile buffers that are stored, by kind: primary hits, their points and materials, w, delta of each light,
the edges of adaptive sampling."""


def codec_of(name: str) -> BufferCodec | None:
    """The encoding of the tile buffer `name`; None if it is not stored."""
    return CODECS.get(name.partition(":")[0])


class StoredBuffer(Record):
    """A buffer of a view as it is stored: (height, planes, samples of a row), truth values as bits."""

    codec: BufferCodec
    values: NDArray[Any]
    per_pixel: int

    def tile(self, tile: Tile) -> NDArray[Any]:
        """(planes, N) of the samples of a tile."""
        first, last = tile.x * self.per_pixel, (tile.x + tile.width) * self.per_pixel
        rows = self.values[tile.y : tile.y + tile.height]
        if self.codec.dtype is np.bool_:
            byte = first // 8
            bits = np.unpackbits(rows[..., byte : -(-last // 8)], axis=-1)
            block = bits[..., first - 8 * byte : last - 8 * byte]
        else:
            block = rows[..., first:last]
        return block.transpose(1, 0, 2).reshape(self.codec.planes, -1)


class Loads(Protocol):
    """A stored buffer, of all or some of the pixels of a view."""

    @property
    def codec(self) -> BufferCodec: ...

    def tile(self, tile: Tile) -> NDArray[Any]:
        """(planes, N) of the samples of a tile."""


def load_hits(stored: Loads, tile: Tile) -> Hits:
    """The stored hits of a tile."""
    objects, triangle, u, v = stored.tile(tile)
    sample = np.flatnonzero(triangle >= 0).astype(np.int32)
    return Hits(
        sample,
        take_or_all(objects, sample),
        take_or_all(triangle, sample),
        take_or_all(u, sample).view(F),
        take_or_all(v, sample).view(F),
    )


def load_pixels(stored: Loads, tile: Tile) -> Any:
    """A stored buffer of a tile with a value for every pixel."""
    return stored.tile(tile)[0].astype(stored.codec.dtype)


def load_tile(stored: Loads, tile: Tile, hits: Hits) -> Any:
    """A stored buffer of a tile, at its hits."""
    return stored.codec.unpack(take_or_all(stored.tile(tile).T, hits.sample).T, hits)


def pack_tile(name: str, buffers: Buffers, tile: Tile, per_pixel: int) -> NDArray[Any] | None:
    """(height, planes, samples of a row) of a tile's buffer, -1 or 0 at samples without a hit; None if it
    cannot be stored."""
    codec = codec_of(name)
    packed = None if codec is None else codec.pack(buffers[name], buffers)
    if codec is None or packed is None:
        return None
    row = tile.width * (1 if codec.of_pixels else per_pixel)
    out = np.full((codec.planes, tile.height * row), -1 if codec.dtype is np.int32 else 0, codec.dtype)
    out[:, slice(None) if codec.of_pixels else buffers["hits"].sample] = packed
    return out.reshape(codec.planes, tile.height, row).transpose(1, 0, 2)


def stored_buffer(codec: BufferCodec, stored: Stored, view: View) -> StoredBuffer:
    """A buffer of a view, from its entry.

    Raises
    ------
    Misfit
    """
    if [(array.shape, array.dtype) for array in stored.arrays] != [codec.layout(view)]:
        raise Misfit
    return StoredBuffer(codec, stored.arrays[0], view.samples)


# --- buffers of the scene as text and arrays -----------------------------------------------------


def encode(value: Any, arrays: list[NDArray[Any]], seen: dict[int, int]) -> Any:
    """`value` for JSON, with its arrays appended to `arrays`; an array that occurs twice is stored once.

    `seen` maps the `id` of an array to its index.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray):
        turned = value.flags.f_contiguous and not value.flags.c_contiguous
        if id(value) not in seen:
            seen[id(value)] = len(arrays)
            arrays.append(value.T if turned else value)
        return {"array": seen[id(value)], "turned": turned}
    if isinstance(value, tuple | list):
        return {"tuple": [encode(part, arrays, seen) for part in value]}
    if isinstance(value, Mapping):
        return {"dict": [[key, encode(part, arrays, seen)] for key, part in value.items()]}
    if type(value).__name__ not in CLASSES:
        raise TypeError(f"{type(value).__name__} is not stored")
    parts = {name: encode(part, arrays, seen) for name, part in vars(value).items()}
    return {"class": type(value).__name__, "fields": parts}


def decode(data: Any, arrays: tuple[NDArray[Any], ...]) -> Any:
    """The value that `encode` encoded."""
    if not isinstance(data, dict):
        return data
    if "array" in data:
        array = arrays[data["array"]]
        return array.T if data["turned"] else array
    if "tuple" in data:
        return tuple(decode(part, arrays) for part in data["tuple"])
    if "dict" in data:
        return {key: decode(part, arrays) for key, part in data["dict"]}
    cls = CLASSES[data["class"]]
    parts = {name: decode(part, arrays) for name, part in data["fields"].items()}
    for name, part in parts.items():
        if not _fits(part, str(cls.__dataclass_fields__[name].type)):
            raise TypeError(f"{name} of {cls.__name__}")
    return cls(**parts)


def _fits(part: object, declared: str) -> bool:
    """True if a decoded part agrees with its declaration in arrays and None."""
    if part is None:
        return "None" in declared
    if isinstance(part, np.ndarray):
        return declared.startswith(f"NDArray[np.{part.dtype.name}")
    return not declared.startswith("NDArray")


def decode_entry(stored: Stored, expected: type | tuple[type, ...]) -> Any:
    """A buffer of the scene, from its entry.

    Raises
    ------
    Misfit
    """
    try:
        value = decode(stored.about["value"], stored.arrays)
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        raise Misfit from None
    if not isinstance(value, expected):
        raise Misfit
    return value
