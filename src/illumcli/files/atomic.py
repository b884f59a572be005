"""Files that appear whole or not at all: written beside their place, forced to disk, renamed.

A rename is atomic; the two fsyncs keep a crash of the machine from leaving an empty file behind the new name
(Pillai et al. 2014, All file systems are not created equal, OSDI '14).

Every file in the making is created anew, never opened through a link, and locked (flock) by the process that
writes it. A file without a lock was left behind: process numbers and host names tell nothing to a container.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from illumcli.errors import OutputError

_WAYS_OUT = {
    errno.ENOSPC: "free some space or choose another folder",
    errno.EDQUOT: "free some of your quota or choose another folder",
    errno.EFBIG: "raise the limit on file sizes (ulimit -f)",
    errno.EACCES: "choose a folder you may write to",
    errno.EPERM: "choose a folder you may write to",
    errno.EROFS: "choose a folder you may write to",
    errno.ENOTDIR: "part of the path is a file; choose another folder",
    errno.EEXIST: "part of the path is a file; choose another folder",
    errno.ENAMETOOLONG: "shorten the name",
}


_LEFT_OVER = re.compile(r"\.[0-9a-f]{12}\.[0-9a-f]{8}\.part")
_OPEN_FILES = "/proc/self/fd"

_open: set[Path] = set()
"""Parts of this process that are neither committed nor discarded."""
_tidied: set[Path] = set()
"""Folders in which this process has looked for parts that others left behind."""


class AtomicFile:
    """A file in the making: write to `path`, then `commit`; `discard` leaves no trace.

    As a context manager it commits at the end of the block and discards on any exception, interrupts
    included. Missing parent folders are made. Parts that killed processes left behind in the folder are
    removed first. The mode of a file that is replaced is kept, and meanwhile nobody else reads the part.

    Raises
    ------
    OutputError
        What the operating system refuses, here, in `commit`, or in the block while it writes to `path`.
    """

    path: Path
    """To write to: the empty file itself, whatever others do to its name, where the system can say so."""
    target: Path
    """What the file will be called."""

    def __init__(self, target: str | os.PathLike[str]) -> None:
        self._named = os.fspath(target)
        self.target = Path(os.path.realpath(target))  # a link stays a link, the file behind it is replaced
        folder = self.target.parent
        with refusals(self._named):
            self._replaced = _status(self.target)
            if self._replaced is not None and not stat.S_ISREG(self._replaced.st_mode):
                raise OutputError(f"{self._named}: is a folder or a device; give the name of a file")
            folder.mkdir(parents=True, exist_ok=True)
            remove_left_over(folder)
            self._name = beside(self.target, f"{os.urandom(4).hex()}.part")
            _open.add(self._name)  # before it exists: a signal may end this call anywhere
            try:
                self._handle = created(self._name, 0o666 if self._replaced is None else 0o600)
            except OSError:
                _open.discard(self._name)
                raise
        itself = Path(_OPEN_FILES, str(self._handle))
        self.path = itself if itself.exists() else self._name

    def commit(self) -> None:
        """Force the part to disk and give it its name; the name's old file is replaced."""
        try:
            with refusals(self._named):
                os.fsync(self._handle)
                if self._replaced is not None:
                    _make_like(self._handle, self._replaced)
                if not os.path.samestat(os.fstat(self._handle), os.lstat(self._name)):
                    raise OutputError(
                        f"{self._named}: another file took its place; choose a folder of your own"
                    )
                os.replace(self._name, self.target)
            _open.discard(self._name)
        except BaseException:
            self.discard()
            raise
        self._unlock()
        with suppress(OSError):  # some file systems cannot; the file is whole by now
            _force(self.target.parent)

    def discard(self) -> None:
        """Remove what was written so far; nothing happens after `commit`."""
        if self._name in _open:
            with suppress(OSError):
                self._name.unlink(missing_ok=True)
                _open.discard(self._name)
        self._unlock()

    def _unlock(self) -> None:
        if self._handle >= 0:
            with suppress(OSError):  # what matters is on disk
                os.close(self._handle)
            self._handle = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.commit()
            return
        self.discard()
        if isinstance(error, OSError) and error.filename in (None, os.fspath(self.path)):
            raise refused(self._named, error) from error


def remember(part: Path) -> None:
    """Count a file that others make among the parts of this process."""
    _open.add(part)


def forget(part: Path) -> None:
    """It is a part no more."""
    _open.discard(part)


def discard_open() -> None:
    """Remove every part of this process; for the end by a signal, which may fall between any two steps."""
    for path in tuple(_open):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""
    with AtomicFile(path) as part:
        part.path.write_bytes(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` as UTF-8 to `path`, line ends as they are, whole or not at all."""
    write_bytes(path, text.encode())


def refused(place: str, error: OSError) -> OutputError:
    """The operating system's refusal to write `place`: fact and way out."""
    advice = _WAYS_OUT.get(error.errno or 0, "choose another place for the output")
    return OutputError(f"{place}: cannot be written: {error.strerror or error}; {advice}")


def is_full(error: OutputError) -> bool:
    """Was there no space left for what could not be written?"""
    cause = error.__cause__
    return isinstance(cause, OSError) and cause.errno in (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def refusals(place: str) -> Iterator[None]:
    """What the operating system refuses within is an OutputError about `place`."""
    try:
        yield
    except OSError as error:
        raise refused(place, error) from error


def claim(path: Path, create: bool = True) -> int | None:
    """A descriptor for reading and writing of a file that is this process's until it closes it.

    The file is locked, and no name is followed. None where the name is a link or no plain file, where the
    file has another name, another owner or others who may write it, and where it is held already.

    Raises
    ------
    OSError
        The file cannot be opened for another reason.
    """
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC | (os.O_CREAT if create else 0)
    while True:
        try:
            handle = os.open(path, flags, 0o600)
        except OSError as error:
            if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
                return None
            raise
        held = False
        try:
            about = os.fstat(handle)
            is_ours = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and about.st_nlink < 2
            if not is_ours or _lock(handle) != 0:
                return None
            about = os.fstat(handle)
            if about.st_nlink == 0:  # removed before it was locked
                if not create:
                    return None
                continue
            if about.st_mode & 0o022:
                os.unlink(path)
                return None
            held = True
            return handle
        finally:
            if not held:
                os.close(handle)


def created(path: Path, mode: int = 0o600) -> int:
    """A descriptor for reading and writing of a new file, locked until it is closed where there are locks.

    Raises
    ------
    OSError
        FileExistsError where there is something of this name, a link included.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode)
        if _lock(handle) != errno.EWOULDBLOCK and os.fstat(handle).st_nlink:
            return handle
        # another process took it for abandoned before it was locked
        os.close(handle)
        path.unlink(missing_ok=True)


def remove_abandoned(path: Path) -> None:
    """Remove a file whose lock nobody holds, if it is this user's."""
    with suppress(OSError):
        handle = claim(path, create=False)
        if handle is not None:
            with suppress(OSError):
                os.unlink(path)
            os.close(handle)


def _lock(handle: int) -> int:
    """Lock an open file until it is closed; 0, or the number of what stands against it: EWOULDBLOCK where
    another holds it, others where the file system has no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno or errno.EIO
    return 0


def _status(path: Path) -> os.stat_result | None:
    """What the system says of a file; None where there is none."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _make_like(handle: int, old: os.stat_result) -> None:
    """Give an open file the owner, where that is allowed, and the mode of the one that it replaces."""
    mode = stat.S_IMODE(old.st_mode) & 0o777
    new = os.fstat(handle)
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        try:
            os.fchown(handle, old.st_uid, old.st_gid)
        except OSError:
            mode &= 0o707 if new.st_gid != old.st_gid else 0o777  # its group is another
    with suppress(PermissionError):  # some file systems have no modes
        os.fchmod(handle, mode)


def _force(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def beside(target: Path, ending: str) -> Path:
    """A hidden file that belongs to `target`, beside it, by a name that is short whatever `target`'s is."""
    return target.with_name(f".{_digest(os.fsencode(target.name))}.{ending}")


def _digest(name: bytes) -> str:
    return hashlib.blake2b(name, digest_size=6).hexdigest()


def remove_left_over(folder: Path) -> None:
    """Remove the parts in a folder that no process holds; once per folder and process.

    Raises
    ------
    OSError
        The folder cannot be read.
    """
    if folder in _tidied:
        return
    for entry in os.scandir(folder):
        if _LEFT_OVER.fullmatch(entry.name):
            remove_abandoned(Path(entry.path))
    _tidied.add(folder)
