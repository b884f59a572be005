"""A cache folder that other users have written to: their entries and links are not used, and not fatal."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from illumcli.cache import entry as module
from illumcli.cache.entry import Refused, read_entry
from illumcli.cache.store import LIMIT, SUFFIX, Store

KEY = "0123456789abcdef" * 2
ROOT = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
PLACE = {"at": 0, "shape": [4], "dtype": "<f8"}


def planted(path, text, payload=bytes(64)):
    """Write an entry that is sound to the last bit, whatever it says."""
    head = module.HEADER.pack(module.MAGIC, module.FORMAT, len(text), len(payload), b"")[:24]
    sum_ = module.checksum(head + text, [np.frombuffer(payload, np.uint8)])
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(head + sum_ + bytes(8) + text + payload)


def entry(**changes):
    return {"key": KEY, "about": {"buffer": "x"}, "arrays": [PLACE]} | changes


def array(**changes):
    return entry(arrays=[PLACE | changes])


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "kept")


@pytest.fixture
def path(store):
    return store.folder / f"{KEY}{SUFFIX}"


def test_a_planted_entry_that_says_what_it_should_is_read(store, path):
    planted(path, json.dumps(entry()).encode())
    assert store.read(KEY).arrays[0].shape == (4,)


DESCRIPTIONS = {
    "no JSON": b"{",
    "no text": b"\xff\xfe",
    "nothing": b"",
    "deep": b"[" * 100_000,
    "a list": [1],
    "a number": 7,
    "no key": {"about": {}, "arrays": []},
    "another key": entry(key="f" * 32),
    "about a list": entry(about=[1, 2]),
    "about nothing": entry(about=None),
    "no arrays": {"key": KEY, "about": {}},
    "arrays a number": entry(arrays=3),
    "an array a number": entry(arrays=[3]),
    "no place": entry(arrays=[{}]),
    "objects": array(dtype="|O"),
    "text": array(dtype="<U4"),
    "a type of several": array(dtype="f8,f8"),
    "a wide type": array(dtype="|V1000000000"),
    "a type as number": array(dtype=8),
    "a negative side": array(shape=[-1]),
    "two negative sides": array(shape=[-2, -2]),
    "a side of half": array(shape=[0.5]),
    "a side as text": array(shape=["4"]),
    "a shape as number": array(shape=4),
    "more than there is": array(shape=[9]),
    "far more than there is": array(shape=[1 << 62, 1 << 62]),
    "nothing of much": array(shape=[0, 1 << 70]),
    "many sides": array(shape=[1] * 100),
    "a negative place": array(at=-8),
    "a place beyond": array(at=1 << 70),
    "a place as text": array(at="0"),
}


@pytest.mark.parametrize("said", DESCRIPTIONS.values(), ids=DESCRIPTIONS)
def test_a_sound_entry_whose_description_is_none_is_a_miss(store, path, said):
    planted(path, said if isinstance(said, bytes) else json.dumps(said).encode())
    with pytest.raises(Refused):
        read_entry(path, KEY, LIMIT)
    assert list(store.faults()) == [path]
    assert store.read(KEY) is None
    assert "it is computed again" in store.warning
    assert not path.exists()


def test_an_entry_that_would_take_more_than_one_may_is_not_read(store, path):
    planted(path, json.dumps(entry()).encode())
    with path.open("r+b") as file:
        file.write(module.HEADER.pack(module.MAGIC, module.FORMAT, 64, 1 << 40, b""))
        file.truncate(module.HEADER.size + 64 + (1 << 40))
    with pytest.raises(Refused, match="larger than an entry may be"):
        read_entry(path, KEY, store.largest)
    with path.open("r+b") as file:
        file.write(module.HEADER.pack(module.MAGIC, module.FORMAT, 1 << 31, 64, b""))
        file.truncate(module.HEADER.size + 64 + (1 << 31))
    for look in (lambda: read_entry(path, KEY, LIMIT), lambda: module.described(path)):
        with pytest.raises(Refused, match="longer than any"):
            look()


def test_little_memory_costs_time_and_no_entry(store, path, monkeypatch):
    store.save(KEY, {}, [np.ones(1000)])
    monkeypatch.setattr(module, "LARGE", 1000)
    monkeypatch.setattr(module, "free_memory", lambda: 10_000)
    assert store.read(KEY) is None
    assert "memory" in store.warning
    assert path.exists()
    monkeypatch.setattr(module, "free_memory", lambda: None)
    assert store.read(KEY) is not None


def test_no_link_is_followed(store, path, tmp_path):
    store.save(KEY, {}, [np.ones(3)])
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    assert store.read(KEY) is None
    assert "a link, not an entry" in store.warning
    assert not os.path.lexists(path)
    assert (tmp_path / "elsewhere").exists()


def test_a_pipe_does_not_hang(store, path):
    store.folder.mkdir()
    os.mkfifo(path)
    assert store.read(KEY) is None
    assert "not a file" in store.warning


@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_an_entry_that_others_can_write_to_is_a_miss(store, path, mode):
    store.save(KEY, {}, [np.ones(3)])
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(mode)
    assert store.read(KEY) is None
    assert "others can write to it" in store.warning


@ROOT
def test_an_entry_of_another_user_is_a_miss(store, path):
    store.save(KEY, {}, [np.ones(3)])
    os.chown(path, 12345, -1)
    assert store.read(KEY) is None
    assert "belongs to another user (12345)" in store.warning


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777, 0o1777])
def test_a_folder_that_others_can_write_to_is_neither_read_nor_written(store, path, mode):
    store.save(KEY, {}, [np.ones(3)])
    store.folder.chmod(mode)
    again = Store(store.folder)
    assert again.read(KEY) is None
    assert not again.has(KEY)
    assert not again.save("f" * 32, {}, [np.ones(3)])
    assert again.warning == (
        f"cache: {store.folder}: others can write to it; chmod go-w {store.folder}, or name another folder "
        "by ILLUM_CACHE; nothing is read or kept there"
    )
    assert [each.name for each in store.folder.iterdir()] == [path.name]
    store.folder.chmod(0o755)
    assert Store(store.folder).read(KEY) is not None


@ROOT
def test_a_folder_of_another_user_is_neither_read_nor_written(store):
    store.save(KEY, {}, [np.ones(3)])
    os.chown(store.folder, 12345, -1)
    assert Store(store.folder).read(KEY) is None
    assert not store.save("f" * 32, {}, [np.ones(3)])
    assert "belongs to another user (12345)" in store.warning


@ROOT
def test_a_link_of_another_user_to_a_folder_is_not_followed(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "kept").symlink_to(tmp_path / "own")
    store = Store(tmp_path / "kept")
    assert store.save(KEY, {}, [np.ones(3)])
    os.chown(tmp_path / "kept", 12345, -1, follow_symlinks=False)
    assert not store.save("f" * 32, {}, [np.ones(3)])
    assert "belongs to another user" in store.warning


def test_files_of_others_in_the_folder_are_neither_counted_nor_removed(store, path):
    store.save(KEY, {}, [np.ones(3)])
    names = ["film.part", "film.mkv.part", "notes.illum", ".0123.old.part", f"{KEY}.illum.bak"]
    for name in names:
        (store.folder / name).write_bytes(bytes(9))
    assert len(store.prune(0).gone) == 1
    store.finish()
    assert sorted(each.name for each in store.folder.iterdir()) == sorted(names)


CUT = """
import os
from pathlib import Path
import numpy as np
from illumcli.cache.store import Store

store = Store(Path("kept"))
store.save("a" * 32, {}, [np.ones(1 << 18)])
found = store.read("a" * 32)
os.truncate("kept/" + "a" * 32 + ".illum", 4096)
assert found.arrays[0].sum() == 1 << 18
assert store.read("a" * 32) is None
writer = store.writer("b" * 32, {}, [((1 << 18,), np.float64)])
writer.write(np.ones(1 << 18))
(part,) = (name for name in os.listdir("kept") if name.endswith(".part"))
os.truncate("kept/" + part, 4096)
assert not writer.commit()
assert "became shorter" in store.warning or "it is computed again" in store.warning, store.warning
assert os.listdir("kept") == [], os.listdir("kept")
"""


def test_a_file_that_is_cut_short_while_it_is_in_use_ends_no_process(python):
    python(CUT)


FULL = """
import os, sys
from pathlib import Path
import numpy as np
from illumcli.cache.store import Store

store = Store(Path(sys.argv[1], "kept"))
writer = store.writer("a" * 32, {}, [((1 << 18,), np.float64)])
writer.append(0, np.ones(100))
with open(Path(sys.argv[1], "filling"), "wb", buffering=0) as file:
    try:
        while file.write(bytes(4096)) == 4096:
            pass
    except OSError:
        pass
writer.commit()
"""


def test_a_disk_that_is_full_before_an_entry_is_whole_ends_no_process(tmp_path):
    mount = f"mount -t tmpfs -o size=1536k none {tmp_path}"
    command = ["unshare", "-rm", "sh", "-c", f'{mount} && exec "$0" -c "$1" "$2"', sys.executable]
    try:
        able = subprocess.run(["unshare", "-rm", "sh", "-c", mount], capture_output=True).returncode == 0
    except FileNotFoundError:
        able = False
    if not able:
        pytest.skip("may not mount a file system of its own here")
    done = subprocess.run([*command, FULL, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]


# --- what a render makes of it -----------------------------------------------------------------------------

RENDER = """
import sys
from illumcli.cache import policy as artifacts
artifacts.worth = lambda seconds, size: True
from illumcli.cli import illum
illum()
"""


def render(folder, *words):
    command = [sys.executable, "-c", RENDER, "render", "scene.yaml", "-q", "--force", "-o", "x.exr", *words]
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, "ILLUM_CACHE": str(folder / "cache")},
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
    return hashlib.sha256((folder / "x.exr").read_bytes()).hexdigest(), done.stderr


def changed(said, how):
    """A description of another thing: its class or a field, or the shape of a picture."""
    about, places = said["about"], said["arrays"]
    value = about.get("value")
    if how == "no value":
        about.pop("value", None)
        said["arrays"] = []
    elif how == "shape":
        for place in places:
            place["shape"] = [1, *place["shape"]] if "value" not in about else place["shape"]
            place["dtype"] = "<f4" if place["dtype"] == "<i4" else "|u1"
    elif how == "class" and isinstance(value, dict) and "class" in value:
        value["class"] = "Repair" if value["class"] != "Repair" else "RenderSpace"
    elif how == "unknown class" and isinstance(value, dict):
        about["value"] = {"class": "os.system", "fields": {}}
    elif how == "field" and isinstance(value, dict) and "fields" in value:
        value["fields"].pop(next(iter(value["fields"])))
        value["fields"]["more"] = 1
    elif how == "deep" and "value" in about:
        for _ in range(400):
            about["value"] = {"tuple": [about["value"]]}
    elif how == "other value":
        about["value"] = "text"
    return said


@pytest.mark.parametrize(
    "how", ["no value", "shape", "class", "unknown class", "field", "deep", "other value"]
)
def test_a_picture_is_the_same_whatever_the_descriptions_say(folder, how):
    cold, silence = render(folder)
    assert silence == ""
    entries = list((folder / "cache").glob(f"*{SUFFIX}"))
    assert len(entries) > 5
    for path in entries:
        data = path.read_bytes()
        _, _, size, end, _ = module.HEADER.unpack(data[: module.HEADER.size])
        said = json.loads(data[module.HEADER.size :][:size])
        planted(path, json.dumps(changed(said, how)).encode(), data[len(data) - end :])
    warm, told = render(folder)
    assert warm == cold
    if how != "other value":
        assert "holds something else" in told or "none of an entry" in told
    assert render(folder) == (cold, "")
