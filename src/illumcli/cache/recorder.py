"""Keeps the buffers that a run computes, in memory and in the store on disk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache import policy
from illumcli.cache.codec import codec_of, encode, pack_tile
from illumcli.cache.entry_writer import Writer
from illumcli.cache.memory import MemoryCache
from illumcli.cache.speeds import SpeedRecorder
from illumcli.cache.store import Store
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.graph import Buffers
from illumcli.records import Value


class Cache(Value):
    """The places where buffers are kept: in memory between variants, on disk between runs."""

    store: Store | None = None
    memory: MemoryCache | None = None
    speeds: SpeedRecorder | None = None
    """Where the speeds of runs are noted."""

    def accepts(self, name: str) -> bool:
        """True if a buffer of this name may be kept."""
        return self.memory is not None or (self.store is not None and policy.is_kept(name))

    def is_read_again(self, name: str, key: str) -> bool:
        """True if a later run may read a buffer from the store, or the next variant from memory."""
        in_store = self.store is not None and policy.is_kept(name)
        return in_store or (self.memory is not None and key in self.memory.wanted)

    def keep(self, name: str, key: str, value: object, seconds: float) -> None:
        """Keep a buffer of the scene that took `seconds` with all its inputs, if it is worth it."""
        if self.memory is not None:
            self.memory.once[key] = value
        if self.store is None or not policy.is_kept(name):
            return
        arrays: list[NDArray[Any]] = []
        data = encode(value, arrays, {})
        if policy.is_always_kept(name) or policy.worth(seconds, sum(array.nbytes for array in arrays)):
            self.store.save(key, {"buffer": name, "value": data}, arrays)


NO_CACHE = Cache()


class BufferRecorder:
    """Keeps the tile buffers of one view while it is rendered: in memory, and in the store if worth it."""

    def __init__(self, cache: Cache, keys: Mapping[str, str], view: View) -> None:
        self._view = view
        self._keys = keys
        self._memory = cache.memory
        self._writers: dict[str, Writer] = {}
        for name, key in keys.items():
            codec = codec_of(name)
            if cache.store is not None and codec is not None:
                writer = cache.store.writer(key, {"buffer": name}, [codec.layout(view)])
                if writer is not None:
                    self._writers[name] = writer
        self.names = frozenset(self._writers) | frozenset(
            name for name, key in keys.items() if self._memory is not None and key in self._memory.wanted
        )
        """Names of the buffers to take of every tile."""

    def take(self, name: str, buffers: Buffers, tile: Tile, part: Tile | None = None) -> NDArray[Any] | None:
        """A tile's buffer as it is stored, (height, planes, samples of a row); called by any thread.

        If `tile` is larger than the tile to store, `part` is the latter.
        """
        if self._memory is not None:
            self._memory.add(self._keys[name], tile, buffers[name])
        packed = pack_tile(name, buffers, tile, self._view.samples) if name in self._writers else None
        if packed is None or part is None:
            return packed
        rows, columns = part.within(tile)
        each = packed.shape[2] // tile.width
        return packed[rows, :, columns.start * each : columns.stop * each]

    def write(self, row: Mapping[str, list[NDArray[Any] | None]]) -> None:
        """Write the next row of tiles, from left to right."""
        for name, parts in row.items():
            writer = self._writers.get(name)
            if writer is None:
                continue
            packed = [part for part in parts if part is not None]
            if len(packed) < len(parts):
                self._writers.pop(name).discard()
                continue
            values = np.concatenate(packed, axis=2)
            writer.append(0, np.packbits(values, axis=-1) if values.dtype == np.bool_ else values)

    def finish(self, seconds: Mapping[str, float]) -> None:
        """Keep the complete buffers that are worth it.

        `seconds` is the time that each buffer took with all its inputs, by name.
        """
        for name, writer in self._writers.items():
            if policy.worth(seconds[name], writer.bytes):
                writer.commit()
            else:
                writer.discard()
        if self._memory is not None:
            self._memory.complete(frozenset(self._keys.values()))
        self._writers = {}

    def discard(self) -> None:
        """Discard unfinished buffers."""
        for writer in self._writers.values():
            writer.discard()
        self._writers = {}
