"""Claims: processes that write into one folder share the work instead of doing it twice.

A claim is a hidden file beside the output, named by the output and its content. It is created exclusively,
locked (flock), and touched every `BEAT` seconds by its holder, who removes it at the end. A claim is stale
and taken over if its lock is free on the machine that made it, which means that its process has died, or if
it was not touched for `STALE` seconds by the clock of the process that waits. The second rule is for other
machines, whose locks not all file systems show.

A claim saves work and protects nothing: outputs are written whole and are the same bytes whoever writes them.
Where no claim can be made, because the disk is full or the folder is read-only, and where another user or a
link has its name, the work is done without.
"""

from __future__ import annotations

import os
import platform
import re
import stat
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Self

from illumcli.files.atomic import beside, claim, created, remove_left_over, track, untrack

BEAT, STALE = 10.0, 90.0
"""Seconds between two touches of a claim; seconds without a touch after which it is stale. NFS may show the
times of files 60 seconds late."""
ABANDONED = 86400.0
"""Seconds after which an unlocked claim of another machine is removed wherever it is seen."""
_FRESH = 5.0  # [s] within which the process that created a claim has locked it and written its machine
_NAME = re.compile(r"\.[0-9a-f]{12}\.[0-9a-f]{32}\.claim")

_tidied: set[Path] = set()
"""Folders in which this process has removed the claims of killed processes."""


def claim_path(output: Path, content: str) -> Path:
    """The path of the claim on an output of this content."""
    return beside(output, f"{content}.claim")


class Claims:
    """The claims of this process, and what it has seen of those of others."""

    def __init__(self) -> None:
        self._seen: dict[Path, tuple[float, float]] = {}  # claim of another -> its time, when it was first so

    def take(self, path: Path) -> Claim | None:
        """A claim to hold while the work is done; None while another process holds it."""
        missing = []
        try:
            missing = [each for each in path.parents if not each.exists()]
            path.parent.mkdir(parents=True, exist_ok=True)
            tidy(path.parent)
            handle = self._created(path)
        except OSError:  # without a claim the work may be done twice, but it is done
            handle = -1
        return None if handle is None else Claim(path, handle, missing)

    def _created(self, path: Path) -> int | None:
        """The descriptor of a new claim, or of one that is taken over; None if another process holds it."""
        try:
            handle = _new(path)
        except FileExistsError:
            about = os.lstat(path)
            if not stat.S_ISREG(about.st_mode) or about.st_uid != os.geteuid():
                raise  # no claim of this user's processes: nobody waits for it
            taken_over = _stale(path) or self._of_silent(path)
            if taken_over is None:
                return None
            handle = taken_over
            with suppress(OSError):
                remove_left_over(path.parent, again=True)
        with suppress(OSError):  # the disk is full: others judge the claim by its touches
            os.pwrite(handle, _machine(), 0)
        return handle

    def _of_silent(self, path: Path) -> int | None:
        """The descriptor of a new claim in place of one that was not touched for `STALE` seconds, as long as
        this process looked at it; None if there is none."""
        now = time.monotonic()
        try:
            touched = os.lstat(path).st_mtime
            seen, since = self._seen.setdefault(path, (touched, now))
            if seen != touched:
                self._seen[path] = touched, now
            elif now - since > STALE:
                path.unlink()
                return _new(path)
        except (FileNotFoundError, FileExistsError):  # removed just now, or a third process was faster
            pass
        return None


class Claim:
    """A claim that this process holds until the end of the `with` block.

    Parameters
    ----------
    handle : int
        The descriptor of the locked claim; -1 if none could be made.
    folders : sequence of Path
        Folders that were created for it, the deepest first; they are removed if nothing else is in them.
    """

    def __init__(self, path: Path, handle: int, folders: Sequence[Path]) -> None:
        self._path, self._handle, self._folders = path, handle, folders
        self._done = threading.Event()
        self._toucher = threading.Thread(target=self._touch, name="claim", daemon=True)
        if handle >= 0:
            track(path)
            with suppress(RuntimeError):  # too little memory for a thread: the lock remains
                self._toucher.start()

    def _touch(self) -> None:
        while not self._done.wait(BEAT):
            with suppress(OSError):
                os.utime(self._handle)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        if self._toucher.ident is not None:
            self._toucher.join()
        if self._handle >= 0:
            with suppress(OSError):  # it may have been taken over, if this process was stopped for long
                if os.path.samestat(os.fstat(self._handle), os.lstat(self._path)):
                    os.unlink(self._path)
            untrack(self._path)
            os.close(self._handle)
        with suppress(OSError):  # outputs are in them
            for folder in self._folders:
                folder.rmdir()


def tidy(folder: Path) -> None:
    """Remove the claims of killed processes in a folder, with their temporary files; once per folder and
    process.

    Raises
    ------
    OSError
        The folder cannot be read.
    """
    if folder in _tidied:
        return
    for entry in os.scandir(folder):
        if _NAME.fullmatch(entry.name):
            handle = _stale(Path(entry.path))
            if handle is not None:
                with suppress(OSError):
                    os.unlink(entry.path)
                os.close(handle)
                remove_left_over(folder, again=True)
    _tidied.add(folder)


def _new(path: Path) -> int:
    """The descriptor of a new claim.

    Raises
    ------
    OSError
        FileExistsError if another process holds it.
    """
    track(path)  # before it exists, because a signal may interrupt at any point
    try:
        return created(path, 0o644)
    except OSError:
        untrack(path)
        raise


def _stale(path: Path) -> int | None:
    """The locked descriptor of a claim whose process on this machine has died; None if there is none."""
    try:
        handle = claim(path, create=False)
    except OSError:  # removed just now
        return None
    if handle is None:
        return None
    machine, age = os.pread(handle, 64, 0), time.time() - os.fstat(handle).st_mtime
    if machine == _machine() or age > (ABANDONED if machine else _FRESH):
        return handle
    os.close(handle)
    return None


@cache
def _machine() -> bytes:
    """What tells this machine, since it was started, from others; up to 64 bytes."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_bytes().strip()
    except OSError:  # another system than Linux
        return platform.node().encode()[:64]
