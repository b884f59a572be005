"""Buffers in memory that one variant of a sweep leaves to the next."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.film.tiles import Tile
from illumcli.records import Value

LIMIT = 1 << 30
"""Greatest size of all tile buffers together [bytes]."""


class MemoryCache:
    """Buffers by key in this process, of the scene and of tiles; the latter up to `limit` bytes."""

    def __init__(self, wanted: frozenset[str] = frozenset(), limit: int = LIMIT) -> None:
        self.wanted = wanted
        """Keys of buffers that the next variant reads."""
        self.asked = wanted
        """Those of them that the last run asked for."""
        self.kept: frozenset[str] = frozenset()
        """Keys of buffers that stay whatever is run."""
        self.limit = limit
        self.once: dict[str, Any] = {}
        """Buffers of the scene."""
        self.pixels: dict[str, Any] = {}
        """Buffers of some pixels of a view (`cache.pixels`)."""
        self.needed: frozenset[int] = frozenset()
        """Numbers of the objects that any variant so far needed."""
        self._tiles: dict[str, dict[Tile, Any]] = {}
        self._complete: set[str] = set()
        self._bytes = 0
        self._lock = threading.Lock()

    def want(self, keys: frozenset[str]) -> None:
        """Note the keys of buffers that the next variant reads."""
        self.asked, self.wanted = keys, keys | self.kept

    def tiles(self, key: str) -> Mapping[Tile, Any] | None:
        """The buffer of this key by tile; None unless all tiles have it."""
        return self._tiles[key] if key in self._complete else None

    def add(self, key: str, tile: Tile, buffer: object) -> None:
        """Keep a tile's buffer; if the limit is exceeded, drop the key with all its tiles."""
        size = sum(array.nbytes for array in arrays_in(buffer))
        with self._lock:
            if key not in self.wanted or key in self._complete:
                return
            if self._bytes + size > self.limit:
                self.wanted -= {key}
                self._drop(key)
                return
            self._bytes += size
            self._tiles.setdefault(key, {})[tile] = buffer

    def complete(self, keys: frozenset[str]) -> None:
        """Note that every tile of these keys has been added."""
        self._complete |= keys & self._tiles.keys()

    def forget(self, keys: Iterable[str]) -> None:
        """Drop the buffers of these keys with all their tiles."""
        for key in keys:
            self._drop(key)
            self._complete.discard(key)

    def retire(self) -> None:
        """Drop everything that is not wanted, and what lacks tiles since a run was abandoned."""
        self.forget(self._tiles.keys() - (self.wanted & self._complete))
        self.once = {key: value for key, value in self.once.items() if key in self.wanted}
        self.pixels = {key: value for key, value in self.pixels.items() if key in self.wanted}

    def _drop(self, key: str) -> None:
        dropped = self._tiles.pop(key, {})
        self._bytes -= sum(array.nbytes for buffer in dropped.values() for array in arrays_in(buffer))


def arrays_in(value: object) -> Iterator[NDArray[Any]]:
    """Every array in a buffer."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from arrays_in(part)
    elif isinstance(value, Value):
        for part in vars(value).values():
            yield from arrays_in(part)
