"""Stored buffers of some pixels of a view, those that adaptive sampling gave all samples."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache import policy
from illumcli.cache.codec import BufferCodec, Misfit, codec_of, pack_tile
from illumcli.cache.entry import Stored
from illumcli.cache.fingerprint import digest
from illumcli.cache.memory import MemoryCache
from illumcli.cache.store import Store
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.graph import Buffers
from illumcli.records import Record

LIMIT = 1 << 28
"""Greatest size of the buffers of an unfinished view [bytes]; if they exceed it, none is stored."""
FRESH = 0.02
"""An entry is written anew if it gets at least this share of new pixels."""


class PixelBuffer(Record):
    """A buffer of K pixels of a view, as it is stored."""

    codec: BufferCodec
    pixels: NDArray[np.int64]  # (K,) row * width + column, ascending
    values: NDArray[Any]  # (K, planes, samples of a pixel)
    width: int  # of the view

    def tile(self, tile: Tile) -> NDArray[Any]:
        """(planes, N) of the samples of a tile whose pixels are all among these."""
        column, row = tile.pixels()
        values = self.values[np.searchsorted(self.pixels, row * self.width + column)]
        return values.transpose(1, 0, 2).reshape(self.codec.planes, -1)


def pixel_key(key: str) -> str:
    """The key of the entry that holds some pixels of the buffer with this key."""
    return digest((key, "some pixels"))


def pixel_buffer(codec: BufferCodec, stored: Stored, view: View) -> PixelBuffer:
    """A buffer of some pixels, from its entry.

    Raises
    ------
    Misfit
    """
    if len(stored.arrays) != 2 or stored.arrays[0].ndim != 1:
        raise Misfit
    pixels, values = stored.arrays
    shape = (len(pixels), codec.planes, view.samples)
    fits = pixels.dtype == np.int64 and values.dtype == codec.dtype and values.shape == shape
    inside = pixels.min(initial=0) >= 0 and pixels.max(initial=0) < view.width * view.height
    if not (fits and inside and (np.diff(pixels) > 0).all()):
        raise Misfit
    return PixelBuffer(codec, pixels, values, view.width)


def are_among(numbers: NDArray[np.int64], pixels: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of some numbers are those of `pixels`, which ascend."""
    if not len(pixels):
        return np.zeros(numbers.shape, np.bool_)
    at = np.minimum(np.searchsorted(pixels, numbers), len(pixels) - 1)
    return np.asarray(pixels[at] == numbers)


def common_pixels(buffers: Sequence[PixelBuffer]) -> NDArray[np.int64]:
    """The pixels that all buffers have, ascending; none if there is no buffer."""
    common = buffers[0].pixels if buffers else np.zeros(0, np.int64)
    for each in buffers[1:]:
        if not np.array_equal(common, each.pixels):
            common = np.intersect1d(common, each.pixels, assume_unique=True)
    return common


class PixelRecorder:
    """Keeps buffers of some pixels of a view while it is rendered; several threads may use it."""

    def __init__(
        self,
        store: Store | None,
        memory: MemoryCache | None,
        keys: Mapping[str, str],
        known: Mapping[str, PixelBuffer],
        view: View,
    ) -> None:
        self._store, self._memory, self._keys, self._known, self._view = store, memory, keys, known, view
        wanted = {name for name, key in keys.items() if memory is not None and key in memory.wanted}
        named = {name for name in keys if codec_of(name) is not None}
        self.names = frozenset(named if store is not None else named & wanted)
        """Names of the buffers to take of every batch of pixels."""
        self._parts: dict[str, list[tuple[NDArray[np.int64], NDArray[Any]]]] = {
            name: [] for name in self.names
        }
        self._bytes = 0
        self._lock = threading.Lock()

    def take(self, name: str, buffers: Buffers, tile: Tile) -> None:
        """Keep a buffer of some pixels."""
        packed = pack_tile(name, buffers, tile, self._view.samples)
        column, row = tile.pixels()
        with self._lock:
            if packed is None:
                self._parts.pop(name, None)
            elif name in self._parts:
                values = packed[0].reshape(len(packed[0]), len(row), -1).transpose(1, 0, 2)
                self._parts[name].append((row * self._view.width + column, values))
                self._bytes += values.nbytes
                if self._bytes > LIMIT:
                    self._parts.clear()

    def finish(self, seconds: Mapping[str, float]) -> None:
        """Store the buffers that are worth it, joined with the pixels stored before.

        `seconds` is the time that each buffer took with all its inputs, by name.
        """
        for name, parts in self._parts.items():
            known, codec = self._known.get(name), codec_of(name)
            count = sum(len(pixels) for pixels, _ in parts)
            if codec is None or not count or (known and count < FRESH * len(known.pixels)):
                continue
            joined = [*parts, *([(known.pixels, known.values)] if known else [])]
            pixels, first = np.unique(np.concatenate([each for each, _ in joined]), return_index=True)
            values = np.concatenate([each for _, each in joined])[first]
            key, buffer = self._keys[name], PixelBuffer(codec, pixels, values, self._view.width)
            if self._memory is not None and key in self._memory.wanted:
                self._memory.pixels[key] = buffer
            if self._store is not None and policy.worth(seconds[name], values.nbytes):
                self._store.save(pixel_key(key), {"buffer": name}, [pixels, values])
        self._parts = {}
