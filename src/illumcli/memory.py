"""Memory of the system: how much is free, freed memory kept, and memory asked for while it can be refused."""

from __future__ import annotations

import mmap
import sys
from functools import cache

MAP_THRESHOLD, TRIM_THRESHOLD = -3, -1  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD of glibc's malloc.h


@cache
def keep_freed_memory() -> None:
    """Tell glibc to keep what numpy frees for the next array, once per process; nothing elsewhere.

    By default every temporary array above 128 KiB goes back to the system and is faulted in again, page
    by page: that is more than half the time of a pass over 16384 lanes (camera rays: 2.1 ms against 0.9 ms).
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
    """Bytes that are free for a program; None where the system does not say."""
    try:
        with open("/proc/meminfo") as file:
            lines = dict(line.split(":", 1) for line in file)
        return int(lines["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):
        return None
