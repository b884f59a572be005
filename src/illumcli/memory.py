"""Process memory: what is available, limits, keeping freed pages for reuse, checks before libraries load."""

from __future__ import annotations

import mmap
import os
import sys
from functools import cache

from illumcli.errors import LimitError

FREE_SHARE = 0.8
"""Share of the free memory that may be used."""
MAP_THRESHOLD, TRIM_THRESHOLD = -3, -1  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD of glibc's malloc.h


@cache
def keep_freed_memory() -> None:
    """Make glibc keep memory that numpy frees for the next array, once per process; other systems do nothing.

    By default every temporary array above 128 KiB goes back to the system and is faulted in again, page
    by page: that is more than half the time of a pass over 16384 rays (camera rays: 2.1 ms against 0.9 ms).
    """
    import ctypes  # imported here: commands that do not need it start faster

    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(MAP_THRESHOLD, 1 << 26)
        libc.mallopt(TRIM_THRESHOLD, 1 << 27)


def refuse_little(size: int) -> None:
    """Raise MemoryError if the process cannot allocate `size` more bytes.

    Some libraries end the process if there is too little memory while they load.
    """
    try:
        mmap.mmap(-1, size).close()
    except OSError as error:
        raise MemoryError from error


def free_memory() -> int | None:
    """Bytes that this process can still allocate, by the machine's memory and the limits of its control group
    and of itself; None if unknown."""
    sizes = [_left_on_the_machine(), _left_in_the_group(), _left_of_addresses()]
    return min((size for size in sizes if size is not None), default=None)


def refuse_beyond(need: int, what: str, way: str) -> None:
    """Raise LimitError if `what` needs more bytes than may be used; `way` is the remedy."""
    free = free_memory()
    if free is not None and need > FREE_SHARE * free:
        usable = in_words(FREE_SHARE * free)
        raise LimitError(f"{what}: takes about {in_words(need)} of memory, {usable} may be used; {way}")


def peak_memory() -> int:
    """Largest resident size of this process so far [bytes]."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def in_words(count: float) -> str:
    """A number of bytes with a unit."""
    for unit in ("bytes", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.3g} {unit}"
        count /= 1024
    return f"{count:.3g} TiB"


def _left_on_the_machine() -> int | None:
    return _entry("/proc/meminfo", "MemAvailable:", 1024)


def _left_in_the_group() -> int | None:
    """The rest of the limit of the control group, as of a container; its file caches count as free."""
    folder = "/sys/fs/cgroup"
    most, taken = _number(f"{folder}/memory.max"), _number(f"{folder}/memory.current")
    if most is None or taken is None:
        return None
    return max(0, most - taken + (_entry(f"{folder}/memory.stat", "inactive_file", 1) or 0))


def _left_of_addresses() -> int | None:
    """The rest of the limit of `ulimit -v`."""
    try:
        import resource
    except ImportError:  # not on every system
        return None
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    pages = _number("/proc/self/statm")
    if most == resource.RLIM_INFINITY or pages is None:
        return None
    return max(0, most - pages * os.sysconf("SC_PAGE_SIZE"))


def _entry(path: str, key: str, unit: int) -> int | None:
    """The number after `key` in a file of lines; None if there is none."""
    try:
        with open(path) as file:
            return next((int(line.split()[1]) * unit for line in file if line.startswith(key)), None)
    except (OSError, ValueError, IndexError):
        return None


def _number(path: str) -> int | None:
    """The first number in a file; None if there is none."""
    try:
        with open(path) as file:
            return int(file.read().split()[0])
    except (OSError, ValueError, IndexError):
        return None
