"""Outputs before any work is done: may they be written, and do they already hold what would be written?

Every file names the content it was made from, or those that its rows and entries were made from. Equal
contents give equal files, except for what differs from run to run: seconds, rays, what was reused. So an
output is known to be up to date without making it again. It also holds its own hash, which shows damage.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import refusals, remove_left_over
from illumcli.files.seal import is_sealed

INCOMPLETE = "incomplete"
"""The content of what failed: a file that holds it may be replaced."""
_OR_CHANGED = ", or one that was changed or damaged since it was written"
ContentReader: TypeAlias = Callable[[Path], Sequence[str]]
"""Reads the contents that a file names; `report_contents`, `image_contents`, `baked_contents`. It may
raise InputError, KeyError, TypeError or ValueError for files of others."""


def refuse_suffix(path: Path, what: str, *suffixes: str) -> None:
    """Raise InputError where `path` ends in none of `suffixes`, as `what` is written."""
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: {what} is written as {' or '.join(suffixes)}; let the name end so")


def is_kept(path: Path, contents: Sequence[str], read: ContentReader, force: bool = False) -> bool:
    """True where the file is there already with the same contents, so that it is as good as written.

    Otherwise it is going to be written, and whatever prevents that is raised now. Nothing is created, not
    even a folder.

    Parameters
    ----------
    contents
        What the file will be made from.
    read
        Of the file's format.
    force
        Replace a file that is different.

    Raises
    ------
    OutputError
        A different file stands there and `force` is not given; the file cannot be written.
    """
    with refusals(str(path)):
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
    """The same as `stored_contents`; OutputError where the file there cannot be read."""
    try:
        return list(stored_contents(path, read))
    except OSError as error:
        fact = f"a file is there that cannot be read: {error.strerror or error}"
        raise OutputError(f"{path}: {fact}; use --force to replace it, or another name") from error


def refuse_empty_link(path: Path) -> None:
    """Raise OutputError where `path` is a link to nothing: what others plant shall make no file elsewhere."""
    if path.is_symlink() and not path.exists():
        raise OutputError(f"{path}: is a link to nothing; use --force to write there, or another name")


def is_complete(path: Path, read: ContentReader) -> bool:
    """Is there a file in which nothing is missing?"""
    return path.is_file() and INCOMPLETE not in stored_contents(path, read)


def refresh(path: Path) -> None:
    """Date a file that is kept now, so that `make` takes it for made, and tidy up after killed runs."""
    with suppress(OSError):  # somebody else's file, a folder that is read-only
        os.utime(path)
        remove_left_over(Path(os.path.realpath(path)).parent)


def stored_contents(path: Path, read: ContentReader) -> Sequence[str]:
    """The contents that a file of ours names; empty where it is none, or is not what was written."""
    try:
        return read(path) if is_sealed(path) else []
    except (InputError, KeyError, TypeError, ValueError):
        return []


def refuse_unwritable(path: Path) -> None:
    """Raise OutputError where the operating system will not have `path` written; nothing is made."""
    with refusals(str(path)):
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
