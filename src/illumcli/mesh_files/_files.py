"""Files of a mesh: what may be opened, and how much of it."""

from __future__ import annotations

import os
import stat
from pathlib import Path, PureWindowsPath

from illumcli.errors import InputError, LimitError

LARGEST_FILE = 4 << 30  # [bytes]
LONGEST_NAME = 4096  # letters of a path


def content(path: Path, most: int | None = None) -> bytes:
    """The bytes of a regular file that is not empty and not larger than `LARGEST_FILE`; the first `most`."""
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
    """The file that `path` calls `name`; it lies in `folder` or below, or `InputError` is raised.

    Links are followed first. `place` begins the message, as ``path:line``; `folder` is that of `path` by
    default. The file need not exist.
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
    """The file that `path` calls `name` and, where that is none inside `folder`, what is the matter with it.

    A name that leads out of the folder, or to what is not there, stands for the file of that name in the
    folder of `path` or in `folder`, if there is one. Nothing outside is opened or looked at.

    Parameters
    ----------
    path : Path
        A file in `folder` or below it: the mesh or its library.
    name : str
        With slashes of either kind.

    Returns
    -------
    Path or None, {"", OUTSIDE, MISSING}
    """
    if not 0 < len(name) <= LONGEST_NAME:
        return None, MISSING
    matter = MISSING
    last = PureWindowsPath(name).name
    for start, candidate in ((path, name), (path, last), (folder / path.name, last)):
        try:
            file = beside(start, candidate, "", folder)
        except InputError:
            matter = OUTSIDE
            continue
        if candidate and os.path.isfile(file):
            return file, "" if candidate == name and start == path else matter
    return None, matter
