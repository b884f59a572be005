"""A disk full at any byte, system calls that fail one after the other: an error and no incomplete file."""

from __future__ import annotations

import pytest

COMMON = """
import os, sys, hashlib, shutil
from pathlib import Path
from illumcli.errors import OutputError, known
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.images import exr  # loaded before files may not grow

def files(folder="out"):
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(Path(folder).glob("*"))}

def parts():
    return [str(p) for p in Path(".").rglob("*.part")]

render_scene(RenderJob(Path("scene.yaml"), RenderOptions(threads=1)))
whole = files()
sizes = {p.name: p.stat().st_size for p in Path("out").glob("*")}
"""

FULL = (
    COMMON
    + """
import resource
hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
step, refusals = int(sys.argv[1]), 0
for limit in range(0, max(sizes.values()) + 2 * step, step):
    shutil.rmtree("out")
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        render_scene(RenderJob(Path("scene.yaml"), RenderOptions(threads=1, cache=limit % (2 * step) == 0)))
        complete = True
    except OutputError as error:
        complete, text = False, str(error)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    found = files()
    assert all(whole[name] == found[name] for name in found), (limit, found)
    assert not parts(), (limit, parts())
    if complete:
        assert found == whole, limit
    else:
        refusals += 1
        assert len(text.splitlines()) == 1 and "cannot be written" in text, text
        assert limit < max(sizes.values()), limit
assert complete
render_scene(RenderJob(Path("scene.yaml"), RenderOptions(threads=1)))
assert files() == whole
print(refusals)
"""
)


@pytest.mark.parametrize("step", [2048, pytest.param(128, marks=pytest.mark.slow)])
def test_a_disk_full_at_any_byte_leaves_whole_files_or_none(python, folder, step):
    refused = int(python(FULL, step))
    print(f"every {step} bytes: {refused} disks were full")  # pytest -rP shows it
    assert refused > 3


FAILING = (
    COMMON
    + """
import builtins, errno, io
name, code = sys.argv[1], getattr(errno, sys.argv[2])
counted = {"open": (io, "open"), "os.open": (os, "open"), "fsync": (os, "fsync"), "replace": (os, "replace"),
           "mkdir": (os, "mkdir"), "scandir": (os, "scandir"), "pwrite": (os, "pwrite"), "stat": (os, "stat"),
           "unlink": (os, "unlink"), "utime": (os, "utime"), "pread": (os, "pread")}
place, attribute = counted[name]
real = getattr(place, attribute)
state = {"calls": 0, "fail": 0}

def failing(*words, **more):
    state["calls"] += 1
    if state["calls"] == state["fail"]:
        raise OSError(code, os.strerror(code))
    return real(*words, **more)

setattr(place, attribute, failing)
refused = n = 0
while True:
    n += 1
    shutil.rmtree("out", ignore_errors=True)
    if n % 2:
        shutil.rmtree("cache", ignore_errors=True)
    state.update(calls=0, fail=n)
    try:
        render_scene(RenderJob(Path("scene.yaml"), RenderOptions(threads=1)))
        complete = True
    except Exception as error:
        complete = False
        refused += 1
        fault = known(error)
        assert fault is not None, repr(error)
        of_input = str(fault).startswith(("scene.yaml: ", "thing.obj: "))
        assert fault.exit_code == 2 if of_input else fault.exit_code in (4, 5), repr(error)
        assert len(str(fault).splitlines()) <= 4, str(fault)
    done = state["calls"] < n
    state["fail"] = 0
    found = files() if os.path.isdir("out") else {}
    assert all(whole[name] == found[name] for name in found), (n, found)
    if complete:
        assert found == whole, n
    if name != "unlink":
        assert not parts(), (n, parts())
    if done and complete:
        break
    assert n < 3000
setattr(place, attribute, real)
shutil.rmtree("out", ignore_errors=True)
render_scene(RenderJob(Path("scene.yaml"), RenderOptions(threads=1)))
assert files() == whole and not parts()
print(n, refused)
"""
)
CALLS = {
    "open": "EACCES", "os.open": "ENOSPC", "fsync": "EIO", "replace": "EIO", "mkdir": "EACCES",
    "scandir": "EIO", "pwrite": "ENOSPC", "unlink": "EIO", "pread": "EIO",
}  # fmt: skip


OFTEN = ("open", "fsync", "replace")


@pytest.mark.parametrize(
    "call", [call if call in OFTEN else pytest.param(call, marks=pytest.mark.slow) for call in CALLS]
)
def test_the_nth_system_call_that_fails_is_an_error_and_no_half_file(python, folder, call):
    tried, refused = map(int, python(FAILING, call, CALLS[call]).split())
    print(f"{call}: {tried} tries, {refused} errors")  # pytest -rP shows it
    assert tried >= 1
