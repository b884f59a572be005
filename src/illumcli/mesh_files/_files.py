"""Access to the files of a mesh: which may be opened, and size limits."""

from __future__ import annotations

import os
import stat
from pathlib import Path, PureWindowsPath

from illumcli.errors import InputError, LimitError

LARGEST_FILE = 4 << 30  # [bytes]
LONGEST_NAME = 4096  # letters of a path


def content(path: Path, most: int | None = None) -> bytes:
    """The bytes of a regular file, or the first `most`; refused if it is empty or beyond `LARGEST_FILE`."""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{path}: is a folder; name the mesh file in it")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is no regular file; copy its content to one")
        if status.st_size > LARGEST_FILE:
            size = f"{status.st_size / 2**30:.1f} GiB"
            raise LimitError(f"{path}: has {size}, the limit is {LARGEST_FILE >> 30} GiB; use a smaller mesh")
        with path.open("rb") as file:
            data = file.read(most)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); check the path and its permissions") from None
    if not data:
        raise InputError(f"{path}: is empty; export the mesh again")
    return data


def beside(path: Path, name: str, place: str, folder: Path | None = None) -> Path:
    """The file that a file names; `InputError` if it is not in `folder` or below, after following links.

    The file need not exist.

    Parameters
    ----------
    path : Path
        The file that has the name.
    name : str
        Relative to the folder of `path`.
    place : str
        Where it has the name, ``path:line``; begins the message.
    folder : Path, optional
        By default that of `path`.
    """
    advice = "copy the file beside the mesh and name it alone"
    if Path(name).is_absolute() or PureWindowsPath(name).drive:
        raise InputError(f"{place}: '{name}' is an absolute path; {advice}")
    target = path.parent / name.replace("\\", "/")
    try:
        inside = target.resolve().is_relative_to((folder or path.parent).resolve())
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{place}: '{name}' is no usable path ({error}); {advice}") from None
    if not inside:
        raise InputError(f"{place}: '{name}' leads out of the folder of the mesh; {advice}")
    return target


OUTSIDE, MISSING = "outside the folder of the mesh", "that are not there"
TAKEN = "replaced by those of the same name in it"


def nearby(path: Path, name: str, folder: Path) -> tuple[Path | None, str]:
    """The file that a mesh or its library names, and what is wrong with the name.

    If the name leads out of the folder or to no file, a file of the same name in the folder of `path` or in
    `folder` replaces it, if there is one. Nothing outside of `folder` is accessed.

    Parameters
    ----------
    path : Path
        A file in `folder` or below it: the mesh or its library.
    name : str
        With slashes or backslashes.

    Returns
    -------
    file : Path or None
    fault : {"", OUTSIDE, MISSING}
        Not empty if the name itself leads to no file inside `folder`.
    """
    if not 0 < len(name) <= LONGEST_NAME:
        return None, MISSING
    fault = MISSING
    last = PureWindowsPath(name).name
    for start, candidate in ((path, name), (path, last), (folder / path.name, last)):
        try:
            file = beside(start, candidate, "", folder)
        except InputError:
            fault = OUTSIDE
            continue
        if candidate and os.path.isfile(file):
            return file, "" if candidate == name and start == path else fault
    return None, fault
