"""What is kept between runs and between the variants of a sweep, and when it is worth keeping.

A buffer that is at hand needs no recipe of its own: the book answers with one that loads it, and whatever
only its own recipe needed (the ray core, the meshes) is not reached any more. `KINDS` and `worth` are the
policy.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, take_or_all
from illumcli.cache.store import Store, Stored
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.mesh import Mesh, Substitute
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.repairs import Repair
from illumcli.geometry.scene_geometry import CornerVectors, PlacedMesh, SceneGeometry
from illumcli.graph import Node
from illumcli.rays.interaction import Hits
from illumcli.records import Record, Value
from illumcli.render_graph.keys import Keys, code
from illumcli.render_graph.stages import MeshRepairs
from illumcli.render_space import RenderSpace
from illumcli.shading.materials import Numbering
from illumcli.shading.rates import Points, as_they_are

LOAD_SECONDS = 0.001
LOAD_RATE = 1e9
"""Loading an artifact is taken to last `LOAD_SECONDS` and a second per `LOAD_RATE` bytes, checksum included:
about half as fast as measured."""
MEMORY = 1 << 30
"""Bytes that the variants of a sweep keep in memory for each other."""

ONCE: Mapping[str, type | tuple[type, ...]] = {
    "mesh": Mesh,
    "object_bounds": ObjectBounds,
    "planar_polygons": (PlanarPolygons, type(None)),
    "curved_polygons": (PlanarPolygons, type(None)),
    "camera": tuple,
    "implied_widths": np.ndarray,
    "geometry": SceneGeometry,
    "repairs": MeshRepairs,
    "undirected": MeshRepairs,
    "unnamed": MeshRepairs,
    "corner_normals": CornerVectors,
    "numbering": Numbering,
}
"""Buffers of the whole scene that are kept, by name or by its part before the colon, and their types.

Left out: the ray core, whose tree Embree does not give away, and what is made from these faster than loaded.
"""
ALWAYS = ("camera",)
"""Those that are kept whatever they took: nothing of a view is found without the place of its camera."""
CLASSES = {
    cls.__name__: cls
    for cls in (
        Mesh,
        ObjectBounds,
        PlanarPolygons,
        SceneGeometry,
        PlacedMesh,
        RenderSpace,
        CornerVectors,
        MeshRepairs,
        Repair,
        Numbering,
        Substitute,
    )
}


def worth(seconds: float, size: int) -> bool:
    """Is it worth keeping what took `seconds` of one processor, with all it needs, and has `size` bytes?"""
    return seconds > LOAD_SECONDS + size / LOAD_RATE


# --- buffers of a view, tile by tile --------------------------------------------------------------------


class Kind(Value):
    """How one value per sample, or several, lie in an artifact of a whole picture."""

    dtype: Any
    planes: int
    pack: Callable[[Any, Mapping[str, Any]], NDArray[Any] | None]
    """Buffer, all buffers of the tile -> (planes, M) at the samples seen; None where it cannot be kept."""
    unpack: Callable[[NDArray[Any], Hits], Any]
    """(planes, M) and the samples seen -> buffer."""


def _pack_hits(hits: Hits, buffers: Mapping[str, Any]) -> NDArray[np.int32]:
    return np.stack([hits.triangle, hits.u.view(np.int32), hits.v.view(np.int32)])


def _pack_points(points: Points, buffers: Mapping[str, Any]) -> NDArray[np.float32] | None:
    if points.spread is not as_they_are:
        return None
    return np.concatenate([points.position.T, points.n.T])


def _unpack_points(planes: NDArray[np.float32], hits: Hits) -> Points:
    return Points(hits.triangle, hits.u, hits.v, planes[:3].T, planes[3:].T, as_they_are)


def _pack_material(material: NDArray[np.int32], buffers: Mapping[str, Any]) -> NDArray[np.uint16] | None:
    if buffers["points"].spread is not as_they_are or material.max(initial=0) >= 1 << 16:
        return None
    return material[None].astype(np.uint16)


def _first(planes: NDArray[Any], hits: Hits) -> Any:
    return planes[0]


KINDS = {
    "hits": Kind(np.int32, 3, _pack_hits, lambda planes, hits: hits),
    "points": Kind(np.float32, 6, _pack_points, _unpack_points),
    "material": Kind(np.uint16, 1, _pack_material, lambda planes, hits: planes[0].astype(np.int32)),
    "obscurance": Kind(np.float32, 1, lambda w, buffers: w[None], _first),
    "shadow": Kind(
        np.bool_, 1, lambda delta, buffers: delta[None] != 0, lambda planes, hits: planes[0].astype(F)
    ),
}
"""Buffers of a view that are kept: primary hits, where and how they lie, w, delta of each light."""


def kind_of(name: str) -> Kind | None:
    """How the tile buffer `name` is kept; None for one that is not."""
    return KINDS.get(name.partition(":")[0])


class Picture(Record):
    """An artifact of a whole picture: (height, planes, samples of a row), truth values in bits."""

    kind: Kind
    values: NDArray[Any]
    per_pixel: int

    @classmethod
    def shape(cls, kind: Kind, view: View) -> tuple[tuple[int, ...], Any]:
        """Shape and type of what is stored for a view."""
        row = view.width * view.samples
        if kind.dtype is np.bool_:
            return (view.height, kind.planes, -(-row // 8)), np.uint8
        return (view.height, kind.planes, row), kind.dtype

    def tile(self, tile: Tile) -> NDArray[Any]:
        """(planes, N) of the samples of a tile."""
        first, last = tile.x * self.per_pixel, (tile.x + tile.width) * self.per_pixel
        rows = self.values[tile.y : tile.y + tile.height]
        if self.kind.dtype is np.bool_:
            left = first // 8
            bits = np.unpackbits(rows[..., left : -(-last // 8)], axis=-1)
            block = bits[..., first - 8 * left : last - 8 * left]
        else:
            block = rows[..., first:last]
        return block.transpose(1, 0, 2).reshape(self.kind.planes, -1)


def load_hits(picture: Picture, tile: Tile) -> Hits:
    """The samples of a tile that see a surface, as they were kept."""
    triangle, u, v = picture.tile(tile)
    lane = np.flatnonzero(triangle >= 0).astype(np.int32)
    return Hits(lane, take_or_all(triangle, lane), take_or_all(u, lane).view(F), take_or_all(v, lane).view(F))


def load_tile(picture: Picture, tile: Tile, hits: Hits) -> Any:
    """A buffer of a tile as it was kept, at the samples seen."""
    return picture.kind.unpack(take_or_all(picture.tile(tile).T, hits.sample).T, hits)


def spread_out(kind: Kind, packed: NDArray[Any], hits: Hits, tile: Tile, per_pixel: int) -> NDArray[Any]:
    """(height, planes, samples of a row) of a tile from (planes, M) at the samples seen; -1, 0 elsewhere."""
    row = tile.width * per_pixel
    out = np.full((kind.planes, tile.height * row), -1 if kind.dtype is np.int32 else 0, kind.dtype)
    out[:, hits.sample] = packed
    return out.reshape(kind.planes, tile.height, row).transpose(1, 0, 2)


# --- where they are kept ----------------------------------------------------------------------------------


class Memory:
    """Buffers by key in this process, of tiles and of the whole scene, up to a number of bytes."""

    def __init__(self, wanted: frozenset[str] = frozenset(), limit: int = MEMORY) -> None:
        self.wanted = wanted
        """Keys of buffers that the next variant reads."""
        self.limit = limit
        self.once: dict[str, Any] = {}
        self._tiles: dict[str, dict[Tile, Any]] = {}
        self._complete: set[str] = set()
        self._bytes = 0
        self._lock = threading.Lock()

    def tiles(self, key: str) -> Mapping[Tile, Any] | None:
        """The buffer of this key by tile; None where not every tile has it."""
        return self._tiles[key] if key in self._complete else None

    def add(self, key: str, tile: Tile, buffer: Any) -> None:
        """Keep a tile's buffer; beyond the limit the whole key is given up."""
        size = sum(array.nbytes for array in arrays_in(buffer))
        with self._lock:
            if key not in self.wanted or key in self._complete:
                return
            if self._bytes + size > self.limit:
                self.wanted -= {key}
                gone = self._tiles.pop(key, {})
                self._bytes -= sum(array.nbytes for each in gone.values() for array in arrays_in(each))
                return
            self._bytes += size
            self._tiles.setdefault(key, {})[tile] = buffer

    def complete(self, keys: frozenset[str]) -> None:
        """Every tile of these keys has been added."""
        self._complete |= keys & self._tiles.keys()

    def retire(self) -> None:
        """Let go of everything that is not wanted."""
        for key in self._tiles.keys() - self.wanted:
            gone = self._tiles.pop(key)
            self._complete.discard(key)
            self._bytes -= sum(array.nbytes for each in gone.values() for array in arrays_in(each))
        self.once = {key: value for key, value in self.once.items() if key in self.wanted}


def arrays_in(value: Any) -> Iterator[NDArray[Any]]:
    """Every array in a buffer."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from arrays_in(part)
    elif isinstance(value, Value):
        for part in vars(value).values():
            yield from arrays_in(part)


@dataclass(slots=True)
class Artifacts:
    """What is at hand for one view: in memory, in the store, or in neither.

    With `look` nothing is read: an entry that is there counts as sound.
    """

    store: Store | None = None
    memory: Memory | None = None
    look: bool = False
    reused: dict[str, str] = field(default_factory=dict)
    """Buffer -> where it was found: `memory` or `store`."""
    made: dict[str, Any] = field(default_factory=dict)
    """By key, what this run made of the whole scene before it knew its plan."""

    def recipe(self, name: str, key: str, view: View) -> Node | None:
        """A recipe that loads the buffer; None where it must be made."""
        if key in self.made:
            return Node(name, partial(_known, self.made[key]), {})
        found = self._in_memory(name, key) or self._in_store(name, key, view)
        return found

    def _in_memory(self, name: str, key: str) -> Node | None:
        if self.memory is None:
            return None
        if key in self.memory.once:
            self.reused[name] = "memory"
            return Node(name, partial(_known, self.memory.once[key]), {})
        tiles = self.memory.tiles(key)
        if tiles is None:
            return None
        self.reused[name] = "memory"
        return Node(name, partial(_of_tile, tiles), {"tile": "tile"})

    def _in_store(self, name: str, key: str, view: View) -> Node | None:
        if self.store is None or not is_kept(name):
            return None
        if self.look:
            if not self.store.has(key):
                return None
            self.reused[name] = "store"
            return Node(name, _known, _needs(name))
        stored = self.store.read(key)
        if stored is None:
            return None
        kind = kind_of(name)
        try:
            value = kept_whole(name, stored) if kind is None else kept_picture(kind, stored, view)
        except Misfit:
            self.store.reject(key, f"holds something else than {name.partition(':')[0]}")
            return None
        self.reused[name] = "store"
        if kind is None:
            if self.memory is not None:
                self.memory.once[key] = value
            return Node(name, partial(_known, value), {})
        load = load_hits if name == "hits" else load_tile
        return Node(name, partial(load, value), _needs(name))

    def keeps(self, name: str) -> bool:
        """May a buffer of this name be kept?"""
        return self.memory is not None or (self.store is not None and is_kept(name))

    def keep_once(self, name: str, key: str, value: Any, seconds: float) -> None:
        """Keep a buffer of the whole scene that took `seconds` with all it needs, if it is worth it."""
        if self.memory is not None:
            self.memory.once[key] = value
        if self.store is None or not is_kept(name):
            return
        arrays: list[NDArray[Any]] = []
        said = encode(value, arrays, {})
        if name.partition(":")[0] in ALWAYS or worth(seconds, sum(array.nbytes for array in arrays)):
            self.store.save(key, {"buffer": name, "value": said}, arrays)


def is_kept(name: str) -> bool:
    """Is a buffer of this name ever kept between runs?"""
    return kind_of(name) is not None or name.partition(":")[0] in ONCE


class Misfit(Exception):
    """A sound entry does not hold what its key stands for."""


def kept_whole(name: str, stored: Stored) -> Any:
    """A buffer of the whole scene, from its entry.

    Raises
    ------
    Misfit
    """
    try:
        value = decode(stored.about["value"], stored.arrays)
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        raise Misfit from None
    if not isinstance(value, ONCE[name.partition(":")[0]]):
        raise Misfit
    return value


def kept_picture(kind: Kind, stored: Stored, view: View) -> Picture:
    """A buffer of a view, from its entry.

    Raises
    ------
    Misfit
    """
    if [(array.shape, array.dtype) for array in stored.arrays] != [Picture.shape(kind, view)]:
        raise Misfit
    return Picture(kind, stored.arrays[0], view.samples)


def _needs(name: str) -> dict[str, str]:
    if kind_of(name) is None:
        return {}
    return {"tile": "tile"} if name == "hits" else {"tile": "tile", "hits": "hits"}


def _known(value: Any) -> Any:
    return value


def _of_tile(tiles: Mapping[Tile, Any], tile: Tile) -> Any:
    return tiles[tile]


class Book(Mapping[str, Node]):
    """A book in which every recipe that is asked for is first looked up among the artifacts."""

    def __init__(self, book: Mapping[str, Node], view: View, artifacts: Artifacts) -> None:
        self._book, self._view, self._artifacts = book, view, artifacts
        self.keys_of = Keys(book, view, code())

    def __getitem__(self, name: str) -> Node:
        recipe = self._book[name]
        if not self._artifacts.memory and not is_kept(name):
            return recipe
        return self._artifacts.recipe(name, self.keys_of(name), self._view) or recipe

    def __iter__(self) -> Iterator[str]:
        return iter(self._book)

    def __len__(self) -> int:
        return len(self._book)


class Keeper:
    """Keeps the tile buffers of one view while it is rendered: in memory, and in the store if worth it."""

    def __init__(self, artifacts: Artifacts, keys: Mapping[str, str], view: View) -> None:
        self._view = view
        self._keys = keys
        self._memory = artifacts.memory
        self._writers: dict[str, Any] = {}
        for name, key in keys.items():
            kind = kind_of(name)
            if artifacts.store is not None and kind is not None:
                writer = artifacts.store.writer(key, {"buffer": name}, [Picture.shape(kind, view)])
                if writer is not None:
                    self._writers[name] = writer
        self.names = frozenset(self._writers) | frozenset(
            name for name, key in keys.items() if self._memory is not None and key in self._memory.wanted
        )
        """The buffers that every tile hands over."""

    def take(self, name: str, buffers: Mapping[str, Any], tile: Tile) -> NDArray[Any] | None:
        """What the store will hold of a tile's buffer, (height, planes, samples of a row); any thread."""
        if self._memory is not None:
            self._memory.add(self._keys[name], tile, buffers[name])
        kind = kind_of(name)
        if name not in self._writers or kind is None:
            return None
        packed = kind.pack(buffers[name], buffers)
        if packed is None:
            return None
        return spread_out(kind, packed, buffers["hits"], tile, self._view.samples)

    def write(self, row: Mapping[str, list[NDArray[Any] | None]]) -> None:
        """The next row of tiles, from left to right."""
        for name, parts in row.items():
            writer = self._writers.get(name)
            if writer is None:
                continue
            have = [part for part in parts if part is not None]
            if len(have) < len(parts):
                self._writers.pop(name).discard()
                continue
            values = np.concatenate(have, axis=2)
            writer.append(0, np.packbits(values, axis=-1) if values.dtype == np.bool_ else values)

    def finish(self, seconds: Mapping[str, float]) -> None:
        """Keep what is complete and was worth it; `seconds` by name, with all that was needed for it."""
        for name, writer in self._writers.items():
            if worth(seconds[name], writer.bytes):
                writer.commit()
            else:
                writer.discard()
        if self._memory is not None:
            self._memory.complete(frozenset(self._keys.values()))
        self._writers = {}

    def discard(self) -> None:
        """Keep nothing that is not finished."""
        for writer in self._writers.values():
            writer.discard()
        self._writers = {}


# --- buffers of the whole scene as text and arrays -----------------------------------------------------


def encode(value: Any, arrays: list[NDArray[Any]], seen: dict[int, int]) -> Any:
    """`value` as JSON has it, its arrays in a list of their own; an array that occurs twice is kept once."""
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
        raise TypeError(f"{type(value).__name__} is not among what is kept")
    parts = {name: encode(part, arrays, seen) for name, part in vars(value).items()}
    return {"class": type(value).__name__, "fields": parts}


def decode(said: Any, arrays: tuple[NDArray[Any], ...]) -> Any:
    """What `encode` was given."""
    if not isinstance(said, dict):
        return said
    if "array" in said:
        array = arrays[said["array"]]
        return array.T if said["turned"] else array
    if "tuple" in said:
        return tuple(decode(part, arrays) for part in said["tuple"])
    if "dict" in said:
        return {key: decode(part, arrays) for key, part in said["dict"]}
    cls = CLASSES[said["class"]]
    parts = {name: decode(part, arrays) for name, part in said["fields"].items()}
    for name, part in parts.items():
        if not _fits(part, str(cls.__dataclass_fields__[name].type)):
            raise TypeError(f"{name} of {cls.__name__}")
    return cls(**parts)


def _fits(part: Any, declared: str) -> bool:
    """Is the part of a record, as decoded, what its declaration says, as far as arrays and None go?"""
    if part is None:
        return "None" in declared
    if isinstance(part, np.ndarray):
        return declared.startswith(f"NDArray[np.{part.dtype.name}")
    return not declared.startswith("NDArray")
