"""Process memory: what is available, limits, keeping freed pages for reuse, checks before libraries load."""

from __future__ import annotations

import mmap
import os
import sys
from functools import cache

from illumcli.errors import LimitError

FREE_SHARE = 0.8
"""Of the memory that is free: so much may be used."""
MAP_THRESHOLD, TRIM_THRESHOLD = -3, -1  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD of glibc's malloc.h


@cache
def keep_freed_memory() -> None:
    """Tell glibc to keep what numpy frees for the next array, once per process; nothing elsewhere.

    By default every temporary array above 128 KiB goes back to the system and is faulted in again, page
    by page: that is more than half the time of a pass over 16384 rays (camera rays: 2.1 ms against 0.9 ms).
    """
    import ctypes  # a start that needs none of this does not wait for it

    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(MAP_THRESHOLD, 1 << 26)
        libc.mallopt(TRIM_THRESHOLD, 1 << 27)


def refuse_little(size: int) -> None:
    """Raise MemoryError where the process cannot have `size` more bytes.

    Some libraries end the process where they find too little while they load.
    """
    try:
        mmap.mmap(-1, size).close()
    except OSError as error:
        raise MemoryError from error


def free_memory() -> int | None:
    """Bytes that this process may still take: what the machine has, or what its group of processes or its own
    limits leave of that; None where the system does not say."""
    found = [_left_on_the_machine(), _left_in_the_group(), _left_of_addresses()]
    return min((size for size in found if size is not None), default=None)


def refuse_beyond(need: int, what: str, way: str) -> None:
    """Raise LimitError where `what` takes more bytes than may be used; `way` is the way out."""
    free = free_memory()
    if free is not None and need > FREE_SHARE * free:
        usable = in_words(FREE_SHARE * free)
        raise LimitError(f"{what}: takes about {in_words(need)} of memory, {usable} may be used; {way}")


def peak_memory() -> int:
    """Largest resident size of this process so far [bytes]."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def in_words(count: float) -> str:
    """Bytes as people read them."""
    for unit in ("bytes", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.3g} {unit}"
        count /= 1024
    return f"{count:.3g} TiB"


def _left_on_the_machine() -> int | None:
    return _entry("/proc/meminfo", "MemAvailable:", 1024)


def _left_in_the_group() -> int | None:
    """What the limit of a control group leaves, as containers have one; its caches can be dropped."""
    folder = "/sys/fs/cgroup"
    most, taken = _number(f"{folder}/memory.max"), _number(f"{folder}/memory.current")
    if most is None or taken is None:
        return None
    return max(0, most - taken + (_entry(f"{folder}/memory.stat", "inactive_file", 1) or 0))


def _left_of_addresses() -> int | None:
    """What `ulimit -v` leaves."""
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
    """The number behind `key` in a file of lines; None where there is none."""
    try:
        with open(path) as file:
            return next((int(line.split()[1]) * unit for line in file if line.startswith(key)), None)
    except (OSError, ValueError, IndexError):
        return None


def _number(path: str) -> int | None:
    """The first number in a file; None where there is none."""
    try:
        with open(path) as file:
            return int(file.read().split()[0])
    except (OSError, ValueError, IndexError):
        return None
