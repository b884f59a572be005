"""Locales, time zones, odd names, little memory, a thousand runs: the same bytes, no files left behind."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import pytest


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_locale_time_zone_and_hash_seed_change_no_byte(illum, folder):
    found = set()
    for number, environment in enumerate(
        (
            {"LC_ALL": "C", "TZ": "UTC", "PYTHONHASHSEED": "0"},
            {"LC_ALL": "de_DE.UTF-8", "TZ": "Asia/Kathmandu", "PYTHONHASHSEED": "1"},
            {"LC_ALL": "tr_TR.UTF-8", "TZ": "America/St_Johns", "PYTHONHASHSEED": "2"},
            {"LC_ALL": "", "LANG": "", "PYTHONHASHSEED": "3", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        )
    ):
        environment["ILLUM_CACHE"] = str(folder / f"cache{number}")
        done = illum("render", "scene.yaml", "--force", cwd=folder, **environment)
        assert done.returncode == 0, done.stderr
        found.add(tuple(digest(path) for path in sorted((folder / "out").iterdir())))
    assert len(found) == 1


NAMES = {
    "spaces": b"a b  c", "newline": b"new\nline", "not UTF-8": b"\xff\xfe\x80", "Turkish": "İıŞ".encode(),
    "quotes": b"a'b\"c", "braces": b"a{b}", "dash": b"-rf", "long": b"n" * 200, "dots": b"a.b.c",
}  # fmt: skip


OFTEN = ("newline", "not UTF-8", "braces")


@pytest.mark.parametrize(
    "name", [name if name in OFTEN else pytest.param(name, marks=pytest.mark.slow) for name in NAMES]
)
def test_a_scene_of_any_name_renders(folder, tmp_path, name):
    stem = NAMES[name]
    text, mesh = (folder / "scene.yaml").read_text(), (folder / "thing.obj").read_text()
    folder = os.fsencode(tmp_path) + b"/" + stem
    os.mkdir(folder)
    with open(folder + b"/" + stem + b".yaml", "w") as file:
        file.write(text.replace("out/{scene}", "out/x"))
    with open(folder + b"/thing.obj", "w") as file:
        file.write(mesh)
    scene = b"./" + stem + b".yaml"
    named = stem.replace(b"{", b"{{").replace(b"}", b"}}") + b"-o.exr"
    if name == "newline":  # nothing that is no text is asked for as an output
        stem, named = b"o", b"o-o.exr"
    env = {**os.environ, "ILLUM_CACHE": str(tmp_path / "cache"), "PYTHONIOENCODING": "ascii"}

    def illum(command, *words):
        done = [sys.executable, "-m", "illumcli", command, scene, *words]
        return subprocess.run(done, cwd=folder, env=env, capture_output=True, check=False)

    done = illum("render", "--only", "beauty", "-D", "film.width=8", b"-o./" + named)
    assert b"Traceback" not in done.stderr
    if name == "not UTF-8":  # OpenImageIO takes no such name
        assert done.returncode == 2
        assert b"not UTF-8" in done.stderr
        assert os.listdir(folder) == [each for each in os.listdir(folder) if b".part" not in each]
    else:
        assert done.returncode == 0, done.stderr.decode(errors="replace")
        assert stem + b"-o.exr" in os.listdir(folder)
    bad = illum("check", "-D", "film.width=-8")
    assert bad.returncode == 2, bad.stderr.decode(errors="replace")
    assert b"Traceback" not in bad.stderr


LITTLE = """
import resource, runpy, sys
limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
sys.argv = ["illum", "render", "scene.yaml", "--force", "-q", "-t", "2"]
runpy.run_module("illumcli", run_name="__main__")
"""


@pytest.mark.parametrize("steps", [12, pytest.param(60, marks=pytest.mark.slow)])
def test_little_memory_gives_the_right_picture_or_one_line(folder, steps):
    env = {**os.environ, "ILLUM_CACHE": str(folder / "cache")}
    whole, codes = None, []
    for number in range(steps, -1, -1):
        limit = int(40e6 * 100 ** (number / steps))
        done = subprocess.run(
            [sys.executable, "-c", LITTLE, str(limit)],
            cwd=folder,
            env=env,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
        codes.append(done.returncode)
        if done.returncode == 0:
            found = [digest(path) for path in sorted((folder / "out").iterdir())]
            whole = whole or found
            assert found == whole, limit
        else:
            assert done.returncode in (4, 5), (limit, done.returncode, done.stderr[-2000:])
            assert "Traceback" not in done.stderr, (limit, done.stderr[-3000:])
            assert done.stderr.strip(), limit
    assert codes[0] == 0


MANY = """
import os, sys, gc
from pathlib import Path
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

def handles():
    return len(os.listdir("/proc/self/fd"))

count = int(sys.argv[1])
options = RenderOptions(('film={width: 24, height: 16, samples: 1}',), threads=2, force=True)
job = RenderJob(Path('scene.yaml'), options)
for warm in range(30):
    render_scene(job)
gc.collect()
before, opened = resident(), handles()
for number in range(count):
    render_scene(job)
gc.collect()
print(resident() - before, handles() - opened)
"""


@pytest.mark.parametrize("count", [20, pytest.param(1000, marks=pytest.mark.slow)])
def test_many_runs_in_one_process_leak_nothing(python, folder, count):
    grown, opened = map(int, python(MANY, count).split())
    assert opened == 0
    assert grown < 5e6


def test_no_home_and_no_current_folder_stop_nothing(illum, folder, tmp_path):
    words = ("render", folder / "scene.yaml", "-o", folder / "o.exr", "-D", "film.width=16")
    homeless = illum(*words, HOME="", ILLUM_CACHE="", XDG_CACHE_HOME="")
    assert (homeless.returncode, homeless.stderr) == (0, "")
    kept = illum("cache", "list", HOME="", ILLUM_CACHE="", XDG_CACHE_HOME="")
    assert kept.returncode == 2
    assert "ILLUM_CACHE" in kept.stderr
    (tmp_path / "gone").mkdir()
    script = 'cd "$0" && rmdir "$0" && exec "$@"'
    command = ["bash", "-c", script, tmp_path / "gone", sys.executable, "-m", "illumcli", *words, "--force"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
