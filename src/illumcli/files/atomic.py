"""Atomic files: written under a temporary name in the same folder, flushed to disk, then renamed.

A rename is atomic; the two fsyncs prevent a system crash from leaving an empty file under the new name
(Pillai et al. 2014, All file systems are not created equal, OSDI '14).

Every temporary file is created exclusively, never opened through a link, and locked (flock) by the process
that writes it. A temporary file without a lock is abandoned; process numbers and host names would not tell
this between containers.
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

_ADVICE = {
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
"""Temporary files of this process that are neither committed nor discarded."""
_tidied: set[Path] = set()
"""Folders in which this process has removed abandoned temporary files."""


class AtomicFile:
    """A file that appears complete or not at all: write to `path`, then `commit` or `discard`.

    As a context manager it commits at the end of the block and discards on any exception, interrupts
    included. Missing parent folders are created, and abandoned temporary files in the folder are removed
    first. If a file is replaced, its mode is kept, and until then nobody else can read the temporary file.

    Raises
    ------
    OutputError
        An error of the operating system, here, in `commit`, or in the block while it writes to `path`.
    """

    path: Path
    """The temporary file to write to; where the system allows, through its descriptor and not its name."""
    target: Path
    """The final name."""

    def __init__(self, target: str | os.PathLike[str]) -> None:
        self._named = os.fspath(target)
        self.target = Path(os.path.realpath(target))  # a link is kept, and the file that it leads to replaced
        folder = self.target.parent
        with os_errors_as_output_errors(self._named):
            self._replaced = _status(self.target)
            if self._replaced is not None and not stat.S_ISREG(self._replaced.st_mode):
                raise OutputError(f"{self._named}: is a folder or a device; give the name of a file")
            folder.mkdir(parents=True, exist_ok=True)
            remove_left_over(folder)
            self._name = beside(self.target, f"{os.urandom(4).hex()}.part")
            _open.add(self._name)  # before it exists, because a signal may interrupt at any point
            try:
                self._handle = created(self._name, 0o666 if self._replaced is None else 0o600)
            except OSError:
                _open.discard(self._name)
                raise
        by_descriptor = Path(_OPEN_FILES, str(self._handle))
        self.path = by_descriptor if by_descriptor.exists() else self._name

    def commit(self) -> None:
        """Flush the temporary file to disk and rename it, which replaces an old file of this name."""
        try:
            with os_errors_as_output_errors(self._named):
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
        with suppress(OSError):  # not supported by all file systems; the file itself is complete
            _force(self.target.parent)

    def discard(self) -> None:
        """Remove the temporary file; no effect after `commit`."""
        if self._name in _open:
            with suppress(OSError):
                self._name.unlink(missing_ok=True)
                _open.discard(self._name)
        self._unlock()

    def _unlock(self) -> None:
        if self._handle >= 0:
            with suppress(OSError):  # the data are on disk already
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


def track(path: Path) -> None:
    """Add a file to the temporary files of this process, which `discard_open` removes."""
    _open.add(path)


def untrack(path: Path) -> None:
    """Stop tracking a temporary file."""
    _open.discard(path)


def discard_open() -> None:
    """Remove all temporary files of this process; called if a signal ends it, at any point."""
    for path in tuple(_open):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write `data` to `path` atomically."""
    with AtomicFile(path) as part:
        part.path.write_bytes(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` as UTF-8 to `path` atomically, without changing line ends."""
    write_bytes(path, text.encode())


def refused(place: str, error: OSError) -> OutputError:
    """The error for an output that the operating system cannot write, with advice."""
    advice = _ADVICE.get(error.errno or 0, "choose another place for the output")
    return OutputError(f"{place}: cannot be written: {error.strerror or error}; {advice}")


def no_space_left() -> OSError:
    """The cause of an output that could not be written because no space was left; see `is_full`."""
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def is_full(error: OutputError) -> bool:
    """True if the output could not be written because no space was left."""
    cause = error.__cause__
    return isinstance(cause, OSError) and cause.errno in (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def os_errors_as_output_errors(place: str) -> Iterator[None]:
    """Turn an OSError in the block into an OutputError about the output `place`."""
    try:
        yield
    except OSError as error:
        raise refused(place, error) from error


def claim(path: Path, create: bool = True) -> int | None:
    """Open and lock a file; the descriptor, for reading and writing, holds the lock until it is closed.

    Links are not followed. None if the path is a link or not a regular file, if the file has another name or
    owner or is writable by others, or if it is locked already.

    Raises
    ------
    OSError
        The file cannot be opened for another reason.
    """
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC | (os.O_CREAT if create else 0)
    while True:  # until the locked file is one that still has its name
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
            # Between opening and locking, another process may have removed the file.
            about = os.fstat(handle)
            if about.st_nlink == 0:
                if not create:
                    return None
                continue
            # Others could have written into it, or hold it open: it is not used.
            if about.st_mode & 0o022:
                os.unlink(path)
                return None
            held = True
            return handle
        finally:
            if not held:
                os.close(handle)


def created(path: Path, mode: int = 0o600) -> int:
    """Create and lock a new file; the descriptor, for reading and writing, holds the lock until it is closed.

    Raises
    ------
    OSError
        FileExistsError if the name exists, even as a link.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode)
        if _lock(handle) != errno.EWOULDBLOCK and os.fstat(handle).st_nlink:
            return handle
        # another process considered it abandoned before it was locked
        os.close(handle)
        path.unlink(missing_ok=True)


def remove_abandoned(path: Path) -> None:
    """Remove a file of this user that no process has locked."""
    with suppress(OSError):
        handle = claim(path, create=False)
        if handle is not None:
            with suppress(OSError):
                os.unlink(path)
            os.close(handle)


def _lock(handle: int) -> int:
    """Lock an open file until it is closed; returns 0 or an error number: EWOULDBLOCK if another process
    holds the lock, others if the file system has no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno or errno.EIO
    return 0


def _status(path: Path) -> os.stat_result | None:
    """The status of a file; None if it does not exist."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _make_like(handle: int, old: os.stat_result) -> None:
    """Give an open file the mode and, if permitted, the owner of the file that it replaces."""
    mode = stat.S_IMODE(old.st_mode) & 0o777
    new = os.fstat(handle)
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        try:
            os.fchown(handle, old.st_uid, old.st_gid)
        except OSError:
            mode &= 0o707 if new.st_gid != old.st_gid else 0o777  # no rights for a different group
    with suppress(PermissionError):  # some file systems have no modes
        os.fchmod(handle, mode)


def _force(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def beside(target: Path, ending: str) -> Path:
    """A hidden file in the folder of `target`, with a name derived from `target`'s that is always short."""
    return target.with_name(f".{_digest(os.fsencode(target.name))}.{ending}")


def _digest(name: bytes) -> str:
    return hashlib.blake2b(name, digest_size=6).hexdigest()


def remove_left_over(folder: Path, again: bool = False) -> None:
    """Remove the abandoned temporary files in a folder; once per folder and process, unless `again`.

    Raises
    ------
    OSError
        The folder cannot be read.
    """
    if folder in _tidied and not again:
        return
    for entry in os.scandir(folder):
        if _LEFT_OVER.fullmatch(entry.name):
            remove_abandoned(Path(entry.path))
    _tidied.add(folder)
