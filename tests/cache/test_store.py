"""The store returns what was written, or nothing; no accident is fatal, and no folder is required."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from illumcli.cache import entry as module
from illumcli.cache.entry import Refused, described, read_entry
from illumcli.cache.location import default_folder, default_limit, size_of
from illumcli.cache.store import LIMIT, SUFFIX, Store
from illumcli.files import atomic

KEY = "0123456789abcdef" * 2


def arrays():
    rng = np.random.default_rng(3)
    return [rng.random((300, 500)), np.arange(7, dtype=np.int32), np.zeros((0, 3), np.float32)]


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "kept")


def path_of(store, key=KEY):
    return store.folder / f"{key}{SUFFIX}"


def test_what_is_read_is_what_was_kept(store):
    assert store.read(KEY) is None
    assert not store.has(KEY)
    assert store.save(KEY, {"buffer": "hits"}, arrays())
    assert store.has(KEY)
    found = store.read(KEY)
    assert found.about == {"buffer": "hits"}
    for kept, array in zip(found.arrays, arrays(), strict=True):
        assert kept.dtype == array.dtype
        assert kept.shape == array.shape
        assert kept.tobytes() == array.tobytes()
    assert not found.arrays[0].flags.writeable
    assert described(path_of(store))["about"]["buffer"] == "hits"
    assert store.warning is None
    assert [path.name for path in store.folder.iterdir()] == [f"{KEY}{SUFFIX}"]


def test_pieces_make_the_same_entry_as_the_whole(store):
    whole = arrays()[0]
    writer = store.writer(KEY, {}, [(whole.shape, whole.dtype)])
    for first in range(0, 300, 77):
        writer.append(0, whole[first : first + 77])
    assert writer.commit()
    pieces = path_of(store).read_bytes()
    store.save(KEY, {}, [whole])
    assert path_of(store).read_bytes() == pieces


@pytest.mark.parametrize("size", [40, 70_000])
def test_no_flipped_bit_and_no_missing_byte_goes_unseen(store, size):
    store.save(KEY, {"buffer": "x"}, [np.random.default_rng(1).integers(0, 255, size, np.uint8)])
    good = path_of(store).read_bytes()
    rng = np.random.default_rng(2)
    places = {*range(min(400, len(good))), *rng.integers(0, len(good), 200).tolist(), len(good) - 1}
    for place in places:
        bad = bytearray(good)
        bad[place] ^= 1 << int(rng.integers(8))
        path_of(store).write_bytes(bad)
        assert store.read(KEY) is None, place
        assert not path_of(store).exists()
    for end in {0, 1, 63, 64, len(good) // 2, len(good) - 1}:
        path_of(store).write_bytes(good[:end])
        assert store.read(KEY) is None
    path_of(store).write_bytes(good + b"\0")
    assert store.read(KEY) is None
    assert "it is computed again" in store.warning
    path_of(store).write_bytes(good)
    assert store.read(KEY) is not None


def test_words_that_change_places_are_seen(store):
    values = np.arange(50_000, dtype=np.uint64)
    store.save(KEY, {}, [values])
    good = path_of(store).read_bytes()
    swapped = values.copy()
    swapped[[10, 20]] = swapped[[20, 10]]
    swapped[[0, 8192]] = swapped[[8192, 0]]
    path_of(store).write_bytes(good[: -values.nbytes] + swapped.tobytes())
    assert store.read(KEY) is None


def test_an_entry_under_another_name_is_refused(store):
    store.save(KEY, {}, arrays())
    other = "f" * 32
    path_of(store).rename(path_of(store, other))
    assert store.read(other) is None
    assert "the entry of another key" in store.warning


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_cannot_be_written_warns_once_and_goes_on(tmp_path):
    tmp_path.chmod(0o500)
    store = Store(tmp_path / "kept")
    assert not store.save(KEY, {}, arrays())
    assert "cannot be written" in store.warning


def test_a_file_in_the_place_of_the_folder_warns_once_and_goes_on(tmp_path):
    (tmp_path / "kept").write_text("")
    store = Store(tmp_path / "kept")
    assert store.read(KEY) is None
    assert not store.save(KEY, {}, arrays())
    first = store.warning
    assert store.warning.startswith("cache: ")
    assert not store.save(KEY, {}, arrays())
    assert store.warning == first
    assert store.entries() == []


def test_a_full_disk_leaves_nothing_and_goes_on(tmp_path):
    code = f"""
import resource, sys, numpy as np
from pathlib import Path
from illumcli.cache.store import Store
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
store = Store(Path({str(tmp_path)!r}))
assert not store.save({KEY!r}, {{}}, [np.ones(50_000)])
print(store.warning)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "cannot be written: File too large" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_least_recently_used_go_first(store):
    keys = [f"{k:032x}" for k in range(5)]
    for number, key in enumerate(keys):
        store.save(key, {}, [np.zeros(1000)])
        os.utime(path_of(store, key), (1000 + number, 1000 + number))
    store.read(keys[0])
    size = path_of(store, keys[0]).stat().st_size
    done = store.prune(2 * size)
    assert [entry.key for entry in done.gone] == keys[1:4]
    assert done.stayed == {}
    assert [entry.key for entry in store.entries()] == [keys[4], keys[0]]


WRITER = """
import sys
from pathlib import Path
import numpy as np
from illumcli.cache.store import Store
writer = Store(Path(sys.argv[1])).writer("b" * 32, {}, [((1000,), np.float64)])
writer.append(0, np.ones(500))
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_temporary_file_goes_once_its_process_is_gone(store):
    store.save(KEY, {}, [np.zeros(1000)])
    size = path_of(store).stat().st_size
    command = [sys.executable, "-c", WRITER, store.folder]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writing:
        assert writing.stdout.readline() == b"ready\n"
        (part,) = store.folder.glob(".*.part")
        Store(store.folder).finish()
        assert part.exists()
        # what is in the making counts
        assert store.prune(2 * size).gone == ()
        assert len(store.prune(2 * size - 1).gone) == 1
        writing.kill()
    assert part.exists()
    Store(store.folder).finish()
    assert list(store.folder.iterdir()) == []


def test_a_close_that_fails_leaves_nothing(store):
    writer = store.writer(KEY, {}, [((10,), np.float64)])
    file = writer._file

    class Failing:
        def __getattr__(self, name):
            return getattr(file, name)

        def close(self):
            file.close()
            raise OSError(5, "Input/output error")

    writer._file = Failing()
    writer.discard()
    assert list(store.folder.iterdir()) == []


def test_what_cannot_be_removed_stays_and_the_rest_goes(store, monkeypatch):
    keys = [f"{k:032x}" for k in range(3)]
    for number, key in enumerate(keys):
        store.save(key, {}, [np.zeros(1000)])
        os.utime(path_of(store, key), (1000 + number, 1000 + number))
    unlink = Path.unlink

    def refused(path, missing_ok=False):
        if path == path_of(store, keys[0]):
            raise PermissionError(1, "Operation not permitted")
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refused)
    done = store.prune(0)
    assert [entry.key for entry in done.gone] == keys[1:]
    assert done.stayed == {path_of(store, keys[0]): "Operation not permitted"}
    again = Store(store.folder, limit=10_000)
    assert again.save(KEY, {}, [np.zeros(300)])
    again.finish()
    assert "cannot be removed: Operation not permitted" in again.warning


def test_a_folder_in_the_place_of_an_entry_is_none(store):
    (path_of(store) / "more").mkdir(parents=True)
    assert store.entries() == []
    assert not store.has(KEY)
    assert not store.save(KEY, {}, arrays())
    assert "cannot be written" in store.warning
    store.finish()
    assert [path.name for path in store.folder.iterdir()] == [path_of(store).name]


def test_a_long_run_does_not_outgrow_the_limit(tmp_path):
    store = Store(tmp_path, limit=100_000)
    for number in range(60):
        assert store.save(f"{number:032x}", {}, [np.zeros(1000)])
        assert sum(entry.bytes for entry in store.entries()) < 100_000 + store.largest + 9000
    assert store.read(f"{59:032x}") is not None


def test_no_entry_takes_more_than_its_share(tmp_path):
    store = Store(tmp_path, limit=4096)
    assert not store.save(KEY, {}, [np.zeros(1000)])
    assert store.save(KEY, {}, [np.zeros(10)])
    assert store.warning is None


def test_faults_names_what_is_not_sound(store):
    store.save(KEY, {}, arrays())
    assert store.faults() == {}
    path_of(store).write_bytes(b"x" * 100)
    assert list(store.faults()) == [path_of(store)]


def test_an_entry_that_another_process_took_away_is_no_fault(store, monkeypatch):
    for key in (KEY, "b" * 32):
        store.save(key, {}, arrays())
    found = store.entries()
    path_of(store).unlink()
    monkeypatch.setattr(store, "entries", lambda: found)
    assert store.faults() == {}
    assert store.prune(0).gone == tuple(found)


@pytest.mark.parametrize("text", [b"{", b"\xff", b"[" * 60_000])
def test_a_description_that_cannot_be_read_is_refused(store, text):
    head = module.HEADER.pack(module.MAGIC, module.FORMAT, len(text), 0, b"")
    store.folder.mkdir()
    path_of(store).write_bytes(head + text)
    with pytest.raises(Refused, match="its description cannot be read"):
        described(path_of(store))


@pytest.mark.parametrize("data", [b"", b"illum\r\n\0", b"x" * 64])
def test_a_foreign_file_is_not_described(store, data):
    store.folder.mkdir()
    path_of(store).write_bytes(data)
    with pytest.raises(Refused, match="not an entry of this program"):
        described(path_of(store))


def test_an_entry_that_cannot_be_read_costs_time_alone(store):
    path_of(store).mkdir(parents=True)
    assert store.read(KEY) is None
    assert "not a file; it is computed again" in store.warning


def test_what_was_read_outlives_its_file(store):
    store.save(KEY, {}, [np.ones(1 << 18)])
    found = read_entry(path_of(store), KEY, LIMIT)
    store.prune(0)
    assert found.arrays[0].sum() == 1 << 18


def test_the_folder_and_the_limit_come_from_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path))
    monkeypatch.setenv("ILLUM_CACHE_SIZE", "1.5k")
    assert (default_folder(), default_limit()) == (tmp_path, 1536)
    monkeypatch.delenv("ILLUM_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert default_folder() == tmp_path / "xdg" / "illum"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert default_folder().is_absolute()


@pytest.mark.parametrize(
    ("text", "size"),
    [("0", 0), ("512", 512), ("1048575T", 1048575 << 40), ("2G", 2 << 30), ("2 GiB", 2 << 30)],
)
def test_sizes_are_read(text, size):
    assert size_of(text) == size


@pytest.mark.parametrize("text", ["", "many", "-1", "nan", "1e30", "1048576T"])
def test_what_is_no_size_is_refused(text):
    with pytest.raises(ValueError):  # noqa: PT011
        size_of(text)


def test_the_checksum_stays_what_it_is():
    """Caches outlive versions of the program: these bytes are in users' files."""
    data = np.arange(100_000, dtype=np.uint32).view(np.uint8)
    assert module.checksum(b"text", [data[:1000]]).hex()[:16] == "a0d1f05907d0cf9b"
    assert module.checksum(b"text", [data]).hex()[:16] == "2c619bbf4af563d6"


def test_an_entry_may_take_a_quarter_of_the_limit(tmp_path):
    store = Store(tmp_path, limit=4096)
    assert store.save(KEY, {}, [np.zeros(1024, np.uint8)])
    assert not store.save(KEY, {}, [np.zeros(1025, np.uint8)])


@pytest.mark.parametrize("saves", [True, False])
def test_the_end_of_a_run_that_kept_something_prunes(store, saves):
    store.save("a" * 32, {}, [np.zeros(1000)])
    os.utime(path_of(store, "a" * 32), (1000, 1000))
    again = Store(store.folder, limit=12_000)
    if saves:
        assert again.save(KEY, {}, [np.zeros(300)])
    again.limit = 8_100
    again.finish()
    assert path_of(store, "a" * 32).exists() != saves


@pytest.mark.parametrize(("key", "prunes"), [("0" * 32, True), ("f" * 32, False)])
def test_a_run_that_added_little_prunes_where_its_key_says_so(tmp_path, key, prunes):
    large = Store(tmp_path)
    large.save("a" * 32, {}, [np.zeros(60_000)])
    os.utime(path_of(large, "a" * 32), (1000, 1000))
    store = Store(tmp_path, limit=460_000)
    store.save(key, {}, [np.zeros(3)])
    store.finish()
    assert path_of(store, "a" * 32).exists() != prunes


def test_entries_that_stay_are_not_listed(store, monkeypatch):
    store.save(KEY, {}, arrays())
    monkeypatch.setattr(store, "entries", lambda: pytest.fail("listed"))
    assert store.prune(store.limit).gone == ()


def test_a_signal_leaves_no_part_of_an_entry(store):
    writer = store.writer(KEY, {}, [((10,), np.float64)])
    writer.write(np.zeros(10))
    assert len(list(store.folder.iterdir())) == 1
    atomic.discard_open()
    assert list(store.folder.iterdir()) == []
    writer.discard()
    assert store.save(KEY, {}, arrays())
    assert not [path for path in atomic._open if path.parent == store.folder]
