"""Files that appear whole or not at all: written beside their place, forced to disk, renamed.

A rename is atomic; the two fsyncs keep a crash of the machine from leaving an empty file behind the new name
(Pillai et al. 2014, All file systems are not created equal, OSDI '14).
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


_open: set[Path] = set()
"""Parts of this process that are neither committed nor discarded."""


class Part:
    """A file in the making: write to `path`, then `commit`; `discard` leaves no trace.

    As a context manager it commits at the end of the block and discards on any exception, interrupts
    included. Missing parent folders are made. Parts that killed processes of this machine left behind for the
    same target are removed first.

    Raises
    ------
    OutputError
        What the operating system refuses, here, in `commit`, or in the block while it writes to `path`.
    """

    path: Path  # to write to; exists and is empty
    target: Path  # what `path` will be called

    def __init__(self, target: str | os.PathLike[str]) -> None:
        self._named = os.fspath(target)
        self.target = Path(os.path.realpath(target))  # a link stays a link, the file behind it is replaced
        folder = self.target.parent
        self.path = beside(self.target, f"{_host()}.{os.getpid()}.{os.urandom(4).hex()}.part")
        with refusals(self._named):
            if self.target.exists() and not self.target.is_file():
                raise OutputError(f"{self._named}: is a folder or a device; give the name of a file")
            folder.mkdir(parents=True, exist_ok=True)
            _remove_left_over(self.target)
            _open.add(self.path)  # before it exists: a signal may end this call anywhere
            os.close(os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))

    def commit(self) -> None:
        """Force the part to disk and give it its name; the name's old file is replaced."""
        try:
            with refusals(self._named):
                _force(self.path)
                os.replace(self.path, self.target)
            _open.discard(self.path)
        except BaseException:
            self.discard()
            raise
        with suppress(OSError):  # some file systems cannot; the file is whole by now
            _force(self.target.parent)

    def discard(self) -> None:
        """Remove what was written so far; nothing happens after `commit`."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
            _open.discard(self.path)

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
    with Part(path) as part:
        part.path.write_bytes(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` as UTF-8 to `path`, line ends as they are, whole or not at all."""
    write_bytes(path, text.encode())


def refused(place: str, error: OSError) -> OutputError:
    """The operating system's refusal to write `place`: fact and way out."""
    way = _WAYS_OUT.get(error.errno or 0, "choose another place for the output")
    return OutputError(f"{place}: cannot be written: {error.strerror or error}; {way}")


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
            own = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and about.st_nlink < 2
            if not own or not _lock(handle):
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


def created(path: Path) -> int:
    """A descriptor for reading and writing of a new file, locked until it is closed where there are locks.

    Raises
    ------
    OSError
        FileExistsError where there is something of this name, a link included.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        if os.fstat(handle).st_nlink:
            return handle
        os.close(handle)  # another process took it for abandoned before it was locked


def remove_abandoned(path: Path) -> None:
    """Remove a file whose lock nobody holds, if it is this user's."""
    with suppress(OSError):
        handle = claim(path, create=False)
        if handle is not None:
            with suppress(OSError):
                os.unlink(path)
            os.close(handle)


def _lock(handle: int) -> bool:
    """Lock an open file until it is closed; False where another holds it, or the file system has no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _force(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def beside(target: Path, ending: str) -> Path:
    """A hidden file that belongs to `target`, beside it, by a name that is short whatever `target`'s is."""
    return target.with_name(f".{_digest(os.fsencode(target.name))}.{ending}")


def _host() -> str:
    """The machine's name as part of a file name: a process number means nothing on another machine."""
    return _digest(os.uname().nodename.encode())


def _digest(name: bytes) -> str:
    return hashlib.blake2b(name, digest_size=6).hexdigest()


def _remove_left_over(target: Path) -> None:
    """Remove parts of `target` whose process on this machine is gone."""
    ours = re.compile(re.escape(beside(target, _host()).name) + r"\.(\d+)\.[0-9a-f]{8}\.part")
    for entry in os.scandir(target.parent):
        match = ours.fullmatch(entry.name)
        if match and not _alive(int(match[1])):
            with suppress(FileNotFoundError):  # another process was faster
                os.unlink(entry.path)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # somebody else's
        pass
    return True
