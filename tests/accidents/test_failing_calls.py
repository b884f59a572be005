"""Each call by which a command writes fails once, one after the other: an error, or the same bytes."""

from __future__ import annotations

import pytest

SCRIPT = """
import builtins, errno, fcntl, gc, hashlib, io, os, sys
from pathlib import Path

import illumcli.images.exr
from illumcli.cli import illum
from illumcli.errors import IllumError, known

name, code, words = sys.argv[1], getattr(errno, sys.argv[2]), sys.argv[3:]
place, attribute = {"open": (io, "open"), "flock": (fcntl, "flock")}.get(name, (os, name.removeprefix("os.")))
real, out = getattr(place, attribute), os.path.realpath("out")
state = {"calls": 0, "fail": 0}

def files():
    return {p.name: content(p) for p in sorted(Path("out").glob("[!.]*"))}

def content(path):
    # tables, reports and curves of runs hold seconds
    if path.suffix in (".csv", ".json", ".svg") and path.name != "b.csv":
        return len(path.read_text().splitlines()) > 2
    return hashlib.sha256(path.read_bytes()).hexdigest()

def within(what):
    try:
        path = os.readlink(f"/proc/self/fd/{what}") if isinstance(what, int) else os.path.abspath(what)
    except (OSError, TypeError):
        return False
    return os.fspath(path).startswith(out)

def failing(what, *words, **more):
    if not within(what):
        return real(what, *words, **more)
    state["calls"] += 1
    if state["calls"] != state["fail"]:
        return real(what, *words, **more)
    if name == "os.close":
        real(what, *words, **more)
    raise OSError(code, os.strerror(code))

def run():
    try:
        illum.main(words, standalone_mode=False)
        return None
    except Exception as error:
        fault = known(error)
        assert fault is not None and fault.exit_code in (4, 5), repr(error)
        assert len(str(fault).splitlines()) <= 8, str(fault)
        return fault

def emptied():
    for path in Path("out").iterdir():
        path.unlink()

Path("out").mkdir()
told = run()
assert told is None, told
whole, tries, refused = files(), 0, 0
assert whole
handles = len(os.listdir("/proc/self/fd"))
while tries < 500:
    tries += 1
    # every other try finds what the one before it left
    if tries % 2:
        emptied()
    state.update(calls=0, fail=tries)
    setattr(place, attribute, failing)
    told = run()
    setattr(place, attribute, real)
    if told is not None:  # a sheet of what succeeded
        Path("out/sheet.png").unlink(missing_ok=True)
    found = files()
    assert all(whole[path] == found[path] for path in found), (tries, found)
    if told is None:
        assert found == whole, (tries, found)
    refused += told is not None
    if state["calls"] < tries:
        break
assert state["calls"] < tries and told is None
for once_more in range(2):
    assert run() is None and files() == whole
    assert not list(Path("out").glob(".*")), list(Path("out").glob(".*"))
    emptied()
gc.collect()  # an error that was told holds what it was about
assert len(os.listdir("/proc/self/fd")) <= handles, os.listdir("/proc/self/fd")
print("\\n", tries, refused)
"""
SMALL = ("-D", "film={width: 8, height: 6, samples: 1}", "-t", "1", "-q")
COMMANDS = {
    "render": (
        "render", "scene.yaml", *SMALL, "-o", "out/a.exr", "-o", "out/{layer}.png", "--report", "out/r.json",
    ),
    "sweep": (
        "sweep", "scene.yaml", "-t", "1", "-q", "-D", "film.width=8,9", "-D", "film.height=6",
        "-o", "out/{film.width}.png", "--only", "beauty", "--sheet", "out/sheet.png", "--table", "out/t.csv",
    ),
    "ao-bake": (
        "ao-bake", "thing.obj", "-o", "out/a.npz", "-o", "out/a.ply", "-o", "out/a.glb", "--samples", "16",
        "-t", "1", "-q",
    ),
    "converge": (
        "converge", "scene.yaml", "--width", "8", "--from", "2", "--to", "4", "--repeats", "1",
        "-q", "-t", "1", "-o", "out/c.svg",
    ),
    "brdf": ("brdf", "phong", "--view", "lobe", "-o", "out/b.png", "--csv", "out/b.csv"),
}  # fmt: skip
CALLS = {
    "open": "EACCES", "os.open": "ENOSPC", "os.write": "ENOSPC", "os.pwrite": "ENOSPC", "os.fsync": "EIO",
    "os.replace": "EIO", "os.unlink": "EIO", "os.close": "EIO", "os.ftruncate": "EIO", "os.scandir": "EIO",
    "flock": "ENOLCK",
}  # fmt: skip
FEW = (("sweep", "os.replace"), ("ao-bake", "os.pwrite"), ("ao-bake", "os.open"), ("render", "os.close"))


@pytest.mark.parametrize(
    ("command", "call"),
    [
        (command, call) if (command, call) in FEW else pytest.param(command, call, marks=pytest.mark.slow)
        for command in COMMANDS
        for call in CALLS
    ],
)
def test_a_call_that_fails_is_an_error_or_changes_nothing(python, folder, command, call):
    tries, refused = map(int, python(SCRIPT, call, CALLS[call], *COMMANDS[command]).split()[-2:])
    print(f"{command}, {call}: {tries} tries, {refused} errors")  # pytest -rP shows it
    assert tries >= 1
