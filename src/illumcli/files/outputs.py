"""Checks outputs before any work is done: whether they can be written, and whether they are up to date.

Every file holds a hash of everything that its content depends on, or one for each row or entry. Equal hashes
mean equal files, except for values that differ from run to run: seconds, rays, what was reused. So an output
is known to be up to date without computing it again. A file also holds its own hash, which detects damage.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import os_errors_as_output_errors, remove_left_over
from illumcli.files.claims import tidy
from illumcli.files.seal import is_sealed

INCOMPLETE = "incomplete"
"""The content hash of rows and entries that failed; a file that contains it may be replaced."""
_OR_CHANGED = ", or one that was changed or damaged since it was written"
ContentReader: TypeAlias = Callable[[Path], Sequence[str]]
"""Reads the content hashes of a file: `report_contents`, `image_contents`, `baked_contents`. It may raise
InputError, KeyError, TypeError or ValueError for files of other programs."""


def refuse_suffix(path: Path, what: str, *suffixes: str) -> None:
    """Raise InputError if `path` has none of the suffixes that `what` can be written with."""
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: {what} is written as {' or '.join(suffixes)}; let the name end so")


def is_kept(path: Path, contents: Sequence[str], read: ContentReader, force: bool = False) -> bool:
    """True if the file exists with the same contents and need not be written.

    Otherwise an error is raised if the file cannot be written. Nothing is created, not even a folder.

    Parameters
    ----------
    contents
        The content hashes of the file to be written.
    read
        Reader of the hashes for the file's format.
    force
        Replace a different file.

    Raises
    ------
    OutputError
        A different file exists and `force` is False; the file cannot be written.
    """
    with os_errors_as_output_errors(str(path)):
        if path.is_file() and not force:
            stored = _readable_contents(path, read)
            if stored == list(contents) and INCOMPLETE not in stored:
                return True
            pairs = zip(stored, contents, strict=False)
            if len(stored) != len(contents) or any(a not in (b, INCOMPLETE) for a, b in pairs):
                fact = "a different file is there" if stored else f"a different file is there{_OR_CHANGED}"
                raise OutputError(f"{path}: {fact}; use --force to replace it, or another name")
        if not force:
            refuse_empty_link(path)
    refuse_unwritable(path)
    return False


def _readable_contents(path: Path, read: ContentReader) -> list[str]:
    """`stored_contents`, with an OutputError if the file cannot be read."""
    try:
        return list(stored_contents(path, read))
    except OSError as error:
        fact = f"a file is there that cannot be read: {error.strerror or error}"
        raise OutputError(f"{path}: {fact}; use --force to replace it, or another name") from error


def refuse_empty_link(path: Path) -> None:
    """Raise OutputError if `path` is a link to nothing: others could use it to create files elsewhere."""
    if path.is_symlink() and not path.exists():
        raise OutputError(f"{path}: is a link to nothing; use --force to write there, or another name")


def is_complete(path: Path, read: ContentReader) -> bool:
    """True if the file exists and no row or entry of it failed."""
    return path.is_file() and INCOMPLETE not in stored_contents(path, read)


def refresh(path: Path) -> None:
    """Set the time of a kept file to now, so that `make` considers it built; tidy up after killed runs."""
    with suppress(OSError):  # the file of another user, a read-only folder
        os.utime(path)
        folder = Path(os.path.realpath(path)).parent
        remove_left_over(folder)
        tidy(folder)


def stored_contents(path: Path, read: ContentReader) -> Sequence[str]:
    """The content hashes of a file; empty if it was written by another program, or changed since."""
    try:
        return read(path) if is_sealed(path) else []
    except (InputError, KeyError, TypeError, ValueError):
        return []


def refuse_unwritable(path: Path) -> None:
    """Raise OutputError if the operating system does not allow `path` to be written; nothing is created."""
    with os_errors_as_output_errors(str(path)):
        target = Path(os.path.realpath(path))
        if os.path.lexists(target) and not target.is_file():
            raise OutputError(f"{path}: is a folder or a device; give the name of a file")
        folder, names = target.parent, [target.name]
        while not folder.exists():
            names.append(folder.name)
            folder = folder.parent
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        if max(len(os.fsencode(name)) for name in names) > os.pathconf(folder, "PC_NAME_MAX"):
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
        if not os.access(folder, os.W_OK | os.X_OK):
            number = errno.EROFS if os.statvfs(folder).f_flag & os.ST_RDONLY else errno.EACCES
            raise OSError(number, os.strerror(number))
