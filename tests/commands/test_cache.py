"""`illum cache` and renders that share one: listed, verified, pruned; never in the way of a picture."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from illumcli.cache.store import Store
from illumcli.cli.cache import cache as cli
from illumcli.commands import cache
from illumcli.errors import OutputError

SCENE = """
version: 1
film: {width: 96, height: 64, samples: 2}
ambient: 0.2
obscurance: {samples: 16}
materials: {clay: {model: blinn_phong, diffuse: [0.6, 0.4, 0.3]}}
objects: [{mesh: {shape: torus}, material: clay}, {mesh: {shape: plane, size: [8, 8]}}]
lights: [{light: point, name: key, position: [3, 4, 5], intensity: 30}]
outputs: {files: ["{scene}.png"]}
"""


@pytest.fixture
def illum(illum_process):
    """What is kept lasts beyond a process."""
    return illum_process


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A scene and a cache folder of its own."""
    (tmp_path / "ring.yaml").write_text(SCENE)
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "kept"))
    return tmp_path


def test_list_verify_prune_clear(illum, own):
    cold = illum("render", "ring.yaml", "--no-cache", "-o", "cold.png")
    assert cold.returncode == 0, cold.stderr
    assert not (own / "kept").exists()
    illum("render", "ring.yaml")
    listed = illum("cache", "list").stdout
    assert "obscurance" in listed
    entries = list((own / "kept").glob("*.illum"))
    assert f"in {len(entries)} entries" in listed
    bad = bytearray(entries[0].read_bytes())
    bad[-1] ^= 1
    entries[0].write_bytes(bad)
    verified = illum("cache", "verify").stdout
    assert "checksum differs; removed" in verified
    assert f"{len(entries) - 1} sound, 1 removed" in verified
    assert illum("cache", "prune").stdout.startswith("0 removed")
    assert illum("cache", "prune", "--size", "many").returncode == 2
    illum("cache", "clear")
    assert list((own / "kept").iterdir()) == []
    assert (own / "ring.png").read_bytes() == (own / "cold.png").read_bytes()


def entry(own, name, text, used):
    """A file of the cache with this description, last used so many seconds ago."""
    from illumcli.cache.entry import FORMAT, HEADER, MAGIC

    head = HEADER.pack(MAGIC, FORMAT, len(text), 0, b"")
    (own / "kept").mkdir(exist_ok=True)
    path = own / "kept" / f"{name}.illum"
    path.write_bytes(head + text)
    os.utime(path, (time.time() - used,) * 2)
    return path


def test_a_list_tells_what_is_damaged_and_how_long_ago_all_was_used(own):
    good = b'{"about": {"buffer": "hits"}}'
    texts = {"d": good, "c": b"[]", "b": b'{"abouu": 1}', "a": b"{"}
    for (name, text), used in zip(texts.items(), (200_000, 7300, 200, 3), strict=True):
        entry(own, name, text, used)
    found = cache.listing()
    assert [what for _, what in found.entries] == ["hits", "damaged", "damaged", "damaged"]
    lines = cache.table(found).splitlines()
    assert [line.split()[1:3] for line in lines[:-1]] == [["2", "d"], ["2", "h"], ["3", "min"], ["3", "s"]]
    assert lines[-1].startswith(f"{found.bytes:,} of {found.limit:,} bytes in 4 entries")


def test_an_entry_that_another_process_took_away_is_not_listed(own, monkeypatch):
    path = entry(own, "a", b"{}", 1)
    entries = Store(own / "kept").entries()
    path.unlink()
    monkeypatch.setattr(Store, "entries", lambda self: entries)
    assert cache.listing().entries == ()
    assert cache.verify() == cache.Verified(1, {}, {})


def test_what_cannot_be_removed_is_an_error_of_the_output(own, monkeypatch):
    first, second = entry(own, "a", b"{}", 2), entry(own, "b", b"{}", 1)
    unlink = Path.unlink

    def refused(path, missing_ok=False):
        if path == first:
            raise PermissionError(13, "Permission denied")
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refused)
    for words in (["verify"], ["clear"], ["prune", "--size", "0"]):
        with pytest.raises(OutputError, match=r"a\.illum: cannot be removed: Permission denied; check its"):
            CliRunner().invoke(cli, words, catch_exceptions=False)
    monkeypatch.undo()
    assert first.exists()
    assert not second.exists()


def test_a_verification_tells_what_it_could_not_remove(own, monkeypatch):
    path = entry(own, "a", b"{}", 1)
    monkeypatch.setattr(cache, "removed", lambda path: "Permission denied")
    done = CliRunner().invoke(cli, ["verify"])
    assert done.output.splitlines() == [
        f"{path}: damaged: its checksum differs; not removed",
        "0 sound, 0 removed",
    ]
    assert isinstance(done.exception, OutputError)


def test_a_made_up_name_moves_no_cursor(own):
    entry(own, "a", b'{"about": {"buffer": "\\u001b[2J"}}', 1)
    entry(own, "b", b'{"about": {"buffer": ["x"]}}', 1)
    assert [what for _, what in cache.listing().entries] == ["damaged", "damaged"]


@pytest.mark.parametrize("words", [["list"], ["verify"], ["prune"], ["clear"]])
def test_a_folder_that_others_can_write_to_is_refused_with_the_way_out(illum, own, words):
    path = entry(own, "a", b"{}", 1)
    (own / "kept").chmod(0o777)
    done = illum("cache", *words)
    assert done.returncode == 2
    assert (
        f"{own / 'kept'}: others can write to it; chmod go-w {own / 'kept'}, or name another" in done.stderr
    )
    assert path.exists()


UNREMOVABLE = """
import sys
from pathlib import Path
unlink = Path.unlink

def refused(path, missing_ok=False):
    if path.suffix == ".illum":
        raise PermissionError(1, "Operation not permitted")
    unlink(path, missing_ok)

Path.unlink = refused
from illumcli.cache import policy as artifacts
artifacts.worth = lambda seconds, size: True
from illumcli.cli import illum
illum()
"""


def test_a_picture_is_done_where_no_entry_can_be_removed(own, monkeypatch):
    monkeypatch.setenv("ILLUM_CACHE_SIZE", "800k")
    command = [sys.executable, "-c", UNREMOVABLE, "render", "ring.yaml", "--force"]
    for k in range(4):
        change = ["-D", f"camera.position=[3,2,{4 + k}]"]
        done = subprocess.run([*command, *change], cwd=own, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert done.stderr.count("cannot be removed: Operation not permitted") == 1, done.stderr


def test_a_plan_says_what_is_at_hand(illum, own):
    assert "reused" not in illum("plan", "ring.yaml").stdout
    illum("render", "ring.yaml")
    planned = illum("plan", "ring.yaml").stdout
    assert "reused  " in planned
    assert "everything that needs it is cached" in planned
    assert "\nrays " not in planned
    memory = planned.partition("\nmemory ")[2]
    assert "shapes " in memory
    assert "band " in memory
    assert "hits " in memory
    assert "reused" not in illum("plan", "ring.yaml", "--no-cache").stdout


@pytest.mark.parametrize("state", ["a file", "read-only", "missing parent"])
def test_no_folder_no_harm_one_warning(illum, own, state, monkeypatch):
    if state == "a file":
        (own / "kept").write_text("")
    elif state == "read-only":
        if os.geteuid() == 0:
            monkeypatch.setenv("ILLUM_CACHE", "/proc/kept")  # nothing is forbidden to root but this
        else:
            (own / "kept").mkdir(mode=0o500)
    else:
        monkeypatch.setenv("ILLUM_CACHE", str(own / "a" / "b" / "kept"))
    illum("render", "ring.yaml", "--no-cache", "-o", "cold.png")
    done = illum("render", "ring.yaml")
    assert done.returncode == 0, done.stderr
    assert (own / "ring.png").read_bytes() == (own / "cold.png").read_bytes()
    assert done.stderr.count("cache: ") == (0 if state == "missing parent" else 1)


def test_a_size_that_is_none_is_refused(illum, own, monkeypatch):
    monkeypatch.setenv("ILLUM_CACHE_SIZE", "a lot")
    done = illum("render", "ring.yaml")
    assert done.returncode == 2
    assert "ILLUM_CACHE_SIZE" in done.stderr


def test_processes_share_one_cache(own):
    code = """
import sys
from pathlib import Path
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
for k in range(3):
    change, name = f"materials.clay.exponent={8 + k}", f"{sys.argv[1]}-{k}.png"
    _, report = render_scene(RenderJob(Path("ring.yaml"), RenderOptions([change], name, force=True)))
    assert not report.warnings, report.warnings
"""
    runs = [
        subprocess.Popen([sys.executable, "-c", code, str(n)], cwd=own, stderr=subprocess.PIPE, text=True)
        for n in range(3)
    ]
    for run in runs:
        assert run.wait() == 0, run.stderr.read()
        run.stderr.close()
    for k in range(3):
        assert len({(own / f"{n}-{k}.png").read_bytes() for n in range(3)}) == 1
    assert not list((own / "kept").glob("*.part"))
