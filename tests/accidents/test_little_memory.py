"""Memory that runs out at one allocation, and at that one only: an error of ours, or a library's own end.

Each process ends by one of these: done, with the same files; exit 4 or 5 and one line; a signal within a
library, which is named and counted. No traceback, no wait and no torn file is allowed. Libraries in Rust end
the process (pydantic builds its validators in one), numpy dereferences the buffer that it did not get for a
ufunc of two types, OpenImageIO one of an EXR that it reads, and Embree's threads may throw: no Python can
hold these. What the program itself asks of Embree must hold.
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from illumcli.errors import LimitError, known
from illumcli.images.exr import ExrFile
from illumcli.images.format import WriteError
from illumcli.schema.modules import modules

SHIM = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <signal.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>
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
static int told;
static void tell(int signal_number) {
  void *frames[64];
  int n = backtrace(frames, 64);
  Dl_info about;
  for (int i = 1; i < n; i++)
    if (dladdr(frames[i], &about) && about.dli_fname) {
      write(told, about.dli_fname, strlen(about.dli_fname));
      write(told, "\\n", 1);
    }
  signal(signal_number, SIG_DFL);
  raise(signal_number);
}
void watch(int descriptor) {
  void *frame;
  static char stack[1 << 16];
  stack_t other = {.ss_sp = stack, .ss_size = sizeof stack};
  struct sigaction action = {.sa_handler = tell, .sa_flags = SA_ONSTACK};
  told = descriptor;
  backtrace(&frame, 1);
  sigaltstack(&other, NULL);
  for (int *each = (int[]){SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, 0}; *each; each++)
    sigaction(*each, &action, NULL);
}
"""
CHILDREN = """
import ctypes, hashlib, json, os, signal, sys, traceback
from pathlib import Path

import numpy as np

import illumcli.images.exr, illumcli.render_graph.execute, illumcli.scene.load
from embreex import mesh_construction, rtcore_scene
from illumcli.cli import main
from illumcli.errors import known
from illumcli.rays.embree import Tracer
from illumcli.rays.embree_library import embree_library as _library

words, least, first, stride = json.loads(sys.argv[1]), *map(int, sys.argv[2:])
shim = ctypes.CDLL(None)
_library()
vertices = np.random.default_rng(1).random((3000, 3)).astype(np.float32)
triangles = np.arange(3000, dtype=np.int32).reshape(-1, 3)
leave = os._exit

def ray_core():
    try:
        Tracer(vertices, triangles)
    except Exception as error:
        if known(error) is None:
            raise
        print(known(error), file=sys.stderr)
        return known(error).exit_code
    return 0

def child(number, told, report):
    os.dup2(told, 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    signal.alarm(120)

    def leaving(code):
        os.write(report, str(shim.counted()).encode())
        leave(code)

    os._exit = leaving
    sys.argv = ["illum", *words]
    shim.watch(ctypes.c_int(report))
    shim.arm(ctypes.c_long(number), ctypes.c_long(least))
    try:
        main() if words else leaving(ray_core())
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        leaving(77)

def files():
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(Path("out").glob("[!.]*"))}

def tried(number):
    Path("out").mkdir(exist_ok=True)
    for path in Path("out").iterdir():
        path.unlink()
    told, report = (os.memfd_create(name) for name in ("told", "report"))
    pid = os.fork()
    if not pid:
        child(number, told, report)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    text, libraries = (os.pread(each, 1 << 20, 0).decode(errors="replace") for each in (told, report))
    os.close(told), os.close(report)
    return code, text, libraries, files()

expected = tried(1 << 60)
assert expected[0] == 0, expected
number = first
while True:
    code, text, report, found = tried(number)
    if code >= 0 and report and int(report) < number:
        break
    print(json.dumps([number, code, text, report if code < 0 else "", found == expected[3],
                      all(expected[3].get(name) == digest for name, digest in found.items())]), flush=True)
    number += stride
"""
NOBODY = (
    "libc", "libpthread", "libgcc", "libstdc++", "ld-linux", "shim", "linux-vdso", "libpython", "python",
)  # fmt: skip
"""Libraries through which others end a process."""
ENDING = {"SIGABRT": ("_pydantic_core", "libembree"), "SIGSEGV": ("_multiarray_umath", "libOpenImageIO")}
"""Libraries that are known to end a process, and how."""

LOADER = "cannot allocate memory for thread-local data: ABORT\n"
"""What the C library prints before it ends a process with exit code 127."""

UNKNOWN_TO_EMBREE = "Embree could not build its tree: error 1\n"
"""Embree reports some allocations that fail as an error that it does not know: exit 1."""

OPENEXR = re.compile(r"<\w+>: \(EXR_ERR_")
"""A line that OpenEXR prints by itself."""


class Tally:
    """What became of processes, in each of which another allocation failed."""

    def __init__(self, lines):
        self.counts, self.faults = Counter(), []
        for number, code, text, libraries, is_all, is_whole in map(json.loads, lines):
            self.counts[self._outcome(code, text, libraries, is_all)] += 1
            if self._outcome(code, text, libraries, is_all) == "fault" or not is_whole:
                self.faults.append((number, code, is_whole, text[-2000:] or libraries[:500]))

    @staticmethod
    def _outcome(code, text, libraries, is_all):
        if code in (-signal.SIGABRT, -signal.SIGSEGV):
            names = [os.path.basename(line) for line in libraries.splitlines()]
            library = next((name for name in names if not name.startswith(NOBODY)), "")
            name = signal.Signals(-code).name
            return f"{name} in {library.partition('.')[0]}" if library.startswith(ENDING[name]) else "fault"
        if code == 0 and is_all and "Traceback" not in text:
            return "finished"
        if (code, text) == (127, LOADER):
            return "exit 127 in the C library"
        if (code, text) == (1, UNKNOWN_TO_EMBREE):
            return "exit 1, unknown to Embree"
        lines = [line for line in text.splitlines() if not OPENEXR.match(line)]
        if code in (4, 5) and len(lines) == 1:
            return f"exit {code}"
        return "fault"


@pytest.fixture
def tried(folder):
    """Run a command, or build Embree's tree, again and again; each time another allocation fails."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if sys.platform != "linux" or compiler is None:
        pytest.skip("needs Linux and a C compiler")
    (folder / "shim.c").write_text(SHIM)
    shim = folder / "shim.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", shim, folder / "shim.c"], check=True)

    # modules are compiled once, as an installation does: else most allocations are the compiler's
    compiled = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(folder / "pyc")}

    def run(words, least, stride, first=1):
        done = subprocess.run(
            [sys.executable, "-c", CHILDREN, json.dumps(words), *map(str, (least, first, stride))],
            cwd=folder, text=True, capture_output=True, check=False,
            env={**os.environ, **compiled, "LD_PRELOAD": str(shim)},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-3000:]
        tally = Tally(done.stdout.splitlines())
        print(*words[:1] or ["Embree tree"], dict(tally.counts))  # pytest -rP shows it
        return tally

    return run


@pytest.mark.parametrize("stride", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_an_allocation_that_fails_while_the_ray_core_is_built_is_an_error(tried, stride):
    tally = tried([], 16, stride)
    assert not tally.faults, tally.faults
    assert tally.counts["exit 4"] > 90 / stride, tally.counts
    assert not any("SIGSEGV" in outcome for outcome in tally.counts), tally.counts


COMMANDS = {
    "render": ("render", "scene.yaml", "-t", "1", "-q", "--no-cache"),
    "ao-bake": ("ao-bake", "thing.obj", "-o", "out/o.npz", "--samples", "64", "-t", "1", "-q"),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("stride", [151, pytest.param(1, marks=pytest.mark.slow)])
def test_an_allocation_that_fails_is_one_line_or_the_end_of_a_library(tried, command, stride):
    tally = tried(COMMANDS[command], 4096, stride)
    assert not tally.faults, (len(tally.faults), tally.faults[:5])
    assert tally.counts["exit 4"], tally.counts


def test_too_little_memory_is_known_by_all_its_names():
    compiled = "<built-in function compile> returned NULL without setting an exception"
    for error in (
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        SyntaxError("expected ':'"),
        ValueError("field 'target' is required for AnnAssign"),
        RuntimeError("can't start new thread"),
        RuntimeError("can't allocate lock"),
        SystemError(compiled),
        SystemError("error return without exception set"),
    ):
        assert isinstance(known(error), LimitError), error
    assert known(RuntimeError("other")) is None
    assert known(ValueError("other")) is None
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
    for fact, kind in (("Unable to run compression routine", MemoryError), ("No space left", WriteError)):
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
