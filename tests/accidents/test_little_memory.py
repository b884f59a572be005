"""Memory that runs out at one allocation, and at that one only: an error of ours, or a library's own end.

Libraries in Rust end the process (pydantic builds its validators in one), numpy dereferences the buffer
that it did not get for a ufunc of two types, and Embree's threads may throw: no Python can hold these. What
the program itself asks of Embree must hold.
"""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from illumcli.errors import LimitError, known
from illumcli.images.oiio import ExrFile
from illumcli.images.writer import Refused
from illumcli.schema.families import modules

SHIM = """
#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
static long number = -1, least;
static atomic_long count;
void arm(long n, long size) { least = size; count = 0; number = n; }
long counted(void) { return count; }
static int fails(size_t size) {
  if (number < 0 || (long)size < least || atomic_fetch_add(&count, 1) + 1 != number) return 0;
  errno = ENOMEM;
  return 1;
}
void *malloc(size_t n) { return fails(n) ? NULL : __libc_malloc(n); }
void *calloc(size_t a, size_t n) { return fails(a * n) ? NULL : __libc_calloc(a, n); }
void *realloc(void *p, size_t n) { return fails(n) ? NULL : __libc_realloc(p, n); }
void *aligned_alloc(size_t a, size_t n) { return fails(n) ? NULL : __libc_memalign(a, n); }
int posix_memalign(void **p, size_t a, size_t n) {
  return fails(n) || !(*p = __libc_memalign(a, n)) ? ENOMEM : 0;
}
"""
CHILDREN = """
import ctypes, os, sys
from pathlib import Path

import numpy as np

import illumcli.images.oiio, illumcli.render_graph.execute, illumcli.scene.load
from embreex import mesh_construction, rtcore_scene
from illumcli.errors import known
from illumcli.baking import bake as ao_bake
from illumcli.commands import render
from illumcli.rays.embree import Tracer
from illumcli.rays.embree_upload import _library

what, least, stride = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
shim = ctypes.CDLL(None)
_library()
vertices = np.random.default_rng(1).random((3000, 3)).astype(np.float32)
triangles = np.arange(3000, dtype=np.int32).reshape(-1, 3)

def bake():
    ao_bake.run(Path("thing.obj"), [Path("out/o.npz")], ao_bake.Settings(samples=64), threads=1, force=True)

work = {
    "ray core": lambda: Tracer(vertices, triangles),
    "render": lambda: render.run(Path("scene.yaml"), threads=1, cache=False, force=True),
    "bake": bake,
}[what]

def child(number):
    code, count = 0, -1
    try:
        shim.arm(ctypes.c_long(number), ctypes.c_long(least))
        work()
    except BaseException as error:
        fault = known(error)
        code = fault.exit_code if fault else 77
    finally:
        count = shim.counted()
        shim.arm(ctypes.c_long(-1), ctypes.c_long(0))
    os._exit(100 if count < number else code)

number, code = 1, None
while code != 100:
    pid = os.fork()
    if not pid:
        child(number)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    print(code)
    number += stride
"""


@pytest.fixture
def codes(folder):
    """The exit codes of processes, in each of which another allocation fails, until none does."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if sys.platform != "linux" or compiler is None:
        pytest.skip("needs Linux and a C compiler")
    (folder / "shim.c").write_text(SHIM)
    shim = folder / "shim.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", shim, folder / "shim.c"], check=True)

    def run(what, least, stride):
        done = subprocess.run(
            [sys.executable, "-c", CHILDREN, what, str(least), str(stride)], cwd=folder, text=True,
            env={**os.environ, "LD_PRELOAD": str(shim)}, capture_output=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-3000:]
        return Counter(map(int, done.stdout.split()))

    return run


@pytest.mark.parametrize("stride", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_an_allocation_that_fails_while_the_ray_core_is_built_is_an_error(codes, stride):
    found = codes("ray core", 16, stride)
    assert found[4] > 90 / stride, found
    assert found[-signal.SIGSEGV] == 0, found
    assert found[77] == 0, found  # a traceback


@pytest.mark.slow
@pytest.mark.parametrize("what", ["render", "bake"])
def test_an_allocation_that_fails_in_a_whole_run_is_an_error_or_the_end_of_a_library(codes, what):
    found = codes(what, 4096, 1)
    ends = found[-signal.SIGABRT] + found[-signal.SIGSEGV]
    # half of the allocations of this size are made while the interpreter compiles and imports
    assert ends < 0.15 * found.total(), found
    assert found[77] < 0.01 * found.total(), found


def test_too_little_memory_is_known_by_all_its_names():
    compiled = "<built-in function compile> returned NULL without setting an exception"
    for error in (
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("can't start new thread"),
        RuntimeError("can't allocate lock"),
        SystemError(compiled),
        SystemError("error return without exception set"),
    ):
        assert isinstance(known(error), LimitError), error
    assert known(RuntimeError("other")) is None
    assert known(SystemError("other")) is None


def test_a_library_that_gives_no_reason_is_named_and_a_quotation_of_it_is_another_fault():
    said = "<ufunc 'add'> returned NULL without setting an exception"
    assert said in str(known(SystemError(said)))
    assert "report it" in str(known(SystemError(said)))
    assert known(SystemError(f"a check of ours: {said} was expected")) is None


def test_an_exr_that_gets_no_memory_to_be_compressed_is_beyond_a_limit(tmp_path):
    file = ExrFile(tmp_path / "a.exr", 8, 8, {"Y": "half"}, {})
    band = np.zeros((8, 8, 1), np.float16)
    said = 'Failed OpenEXR write: Failed to write pixel data to image file "a.exr". '
    for fact, kind in (("Unable to run compression routine", MemoryError), ("No space left", Refused)):
        answers = {"geterror": lambda fact=fact: said + fact, "write_scanlines": lambda *_: False}
        file._output = SimpleNamespace(**answers)
        with pytest.raises(kind):
            file.write(band)


def test_a_folder_of_modules_that_cannot_be_listed_is_not_taken_for_an_empty_one(monkeypatch):
    def refuse(folder):
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM), folder)

    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(OSError, match="memory") as caught:
        modules(["anywhere"])
    assert isinstance(known(caught.value), LimitError)
