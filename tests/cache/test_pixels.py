"""Buffers of some pixels: what entries may hold, and how they are joined."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.cache import pixels, policy
from illumcli.cache.codec import Misfit, codec_of, load_tile
from illumcli.cache.entry import Stored
from illumcli.cache.memory import MemoryCache
from illumcli.cache.pixels import PixelRecorder, are_among, common_pixels, pixel_buffer, pixel_key
from illumcli.cache.store import Store
from illumcli.film.tiles import Scattered
from illumcli.film.view import View
from illumcli.rays.interaction import Hits

VIEW = View("main", None, 10, 6, 2)
W = codec_of("obscurance")


def hits_of(count):
    """Every sample of so many pixels hits something."""
    sample = np.arange(count * VIEW.samples, dtype=np.int32)
    return Hits(sample, sample, sample, sample.astype(np.float32), sample.astype(np.float32))


def values_at(numbers):
    """(2 K,) float32 values that tell pixel and sample."""
    return (np.repeat(numbers, 2) * 10 + np.tile([0, 1], len(numbers))).astype(np.float32)


def scattered(numbers):
    return Scattered.at(np.array(numbers) % 10, np.array(numbers) // 10)


def recorded(store, memory, known, batches):
    """Record w at batches of pixels."""
    recorder = PixelRecorder(store, memory, {"obscurance": "k"}, known, VIEW)
    for batch in batches:
        buffers = {"hits": hits_of(len(batch)), "obscurance": values_at(batch)}
        for name in recorder.names:
            recorder.take(name, buffers, scattered(batch))
    recorder.finish({"obscurance": 1e9})


def loaded(store):
    return pixel_buffer(W, store.read(pixel_key("k")), VIEW)


def test_batches_come_back_in_any_order(tmp_path):
    store = Store(tmp_path)
    recorded(store, None, {}, [[7, 3, 51], [12, 0]])
    buffer = loaded(store)
    assert buffer.pixels.tolist() == [0, 3, 7, 12, 51]
    some = [51, 3, 12]
    assert load_tile(buffer, scattered(some), hits_of(3)).tolist() == values_at(some).tolist()


def test_new_pixels_join_those_that_are_known(tmp_path):
    store, memory = Store(tmp_path), MemoryCache(frozenset({"k"}))
    recorded(store, memory, {}, [range(20)])
    recorded(store, memory, {"obscurance": loaded(store)}, [[40, 30]])
    for buffer in (loaded(store), memory.pixels["k"]):
        assert buffer.pixels.tolist() == [*range(20), 30, 40]
        assert load_tile(buffer, scattered([30, 5]), hits_of(2)).tolist() == values_at([30, 5]).tolist()


def test_few_new_pixels_write_no_entry_anew(tmp_path, monkeypatch):
    store = Store(tmp_path)
    recorded(store, None, {}, [range(20)])
    monkeypatch.setattr(pixels, "FRESH", 0.1)
    recorded(store, None, {"obscurance": loaded(store)}, [[40]])
    assert loaded(store).pixels.tolist() == [*range(20)]


def test_what_is_too_much_or_not_worth_it_is_not_kept(tmp_path, monkeypatch):
    store = Store(tmp_path)
    monkeypatch.setattr(pixels, "LIMIT", 30)
    recorded(store, None, {}, [[1, 2], [3, 4]])
    assert store.read(pixel_key("k")) is None
    monkeypatch.undo()
    monkeypatch.setattr(policy, "worth", lambda seconds, size: False)
    recorded(store, None, {}, [[1, 2]])
    assert store.read(pixel_key("k")) is None


def test_pixels_that_all_buffers_have(tmp_path):
    def buffer(numbers):
        store = Store(tmp_path / str(len(numbers)))
        recorded(store, None, {}, [numbers])
        return loaded(store)

    assert common_pixels([]).tolist() == []
    assert common_pixels([buffer([1, 5, 9]), buffer([5, 9]), buffer([2, 5, 8, 9])]).tolist() == [5, 9]


def test_numbers_among_pixels():
    numbers = np.array([[0, 3, 4], [9, 10, 3]])
    assert are_among(numbers, np.array([3, 9])).tolist() == [[False, True, False], [True, False, True]]
    assert not are_among(numbers, np.zeros(0, np.int64)).any()


GOOD = (np.array([3, 8]), np.zeros((2, 1, 2), np.float32))


@pytest.mark.parametrize(
    "arrays",
    [
        (),
        (GOOD[0],),
        (*GOOD, GOOD[0]),
        (GOOD[0].astype(np.int32), GOOD[1]),
        (GOOD[0], GOOD[1].astype(np.float64)),
        (GOOD[0], GOOD[1][:, :, :1]),
        (GOOD[0][:1], GOOD[1]),
        (GOOD[0][::-1].copy(), GOOD[1]),
        (np.array([3, 3]), GOOD[1]),
        (np.array([-1, 3]), GOOD[1]),
        (np.array([3, 60]), GOOD[1]),
        (np.array([[3, 8]]), GOOD[1]),
        (np.array(3), GOOD[1]),
    ],
)
def test_an_entry_of_another_shape_is_refused(arrays):
    assert pixel_buffer(W, Stored({}, GOOD, 0), VIEW).pixels.tolist() == [3, 8]
    with pytest.raises(Misfit):
        pixel_buffer(W, Stored({}, arrays, 0), VIEW)
