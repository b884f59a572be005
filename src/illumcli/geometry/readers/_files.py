"""Files of a mesh: what may be opened, and how much of it."""

from __future__ import annotations

import stat
from pathlib import Path, PureWindowsPath

from illumcli.errors import InputError, LimitError

LARGEST_FILE = 4 << 30  # [bytes]


def content(path: Path) -> bytes:
    """The bytes of a regular file that is not empty and not larger than `LARGEST_FILE`."""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{path}: is a folder; name the mesh file in it")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is no regular file; copy its content to one")
        if status.st_size > LARGEST_FILE:
            size = f"{status.st_size / 2**30:.1f} GiB"
            raise LimitError(f"{path}: has {size}, the limit is {LARGEST_FILE >> 30} GiB; use a smaller mesh")
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); check the path and its permissions") from None
    if not data:
        raise InputError(f"{path}: is empty; export the mesh again")
    return data


def beside(path: Path, name: str, place: str) -> Path:
    """The file that `path` calls `name`; it lies in the folder of `path` or below, or `InputError` is raised.

    Links are followed first. `place` begins the message, as ``path:line``. The file need not exist.
    """
    way = "copy the file beside the mesh and name it alone"
    if Path(name).is_absolute() or PureWindowsPath(name).drive:
        raise InputError(f"{place}: '{name}' is an absolute path; {way}")
    target = path.parent / name.replace("\\", "/")
    try:
        inside = target.resolve().is_relative_to(path.parent.resolve())
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{place}: '{name}' is no usable path ({error}); {way}") from None
    if not inside:
        raise InputError(f"{place}: '{name}' leads out of the folder of the mesh; {way}")
    return target
