"""What readers of files share: the facts by which a file is known to be the same as before."""

from __future__ import annotations

import os

from illumcli.errors import InputError


def identity(path: str, fault: str = "cannot read the measurement") -> tuple[str, int, int]:
    """Path, time of the last change [ns] and size [bytes].

    Raises
    ------
    InputError
        There is no such file, or it may not be read.
    """
    try:
        facts = os.stat(path)
    except OSError as error:
        raise InputError(f"{path}: {fault}: {error.strerror}") from None
    return path, facts.st_mtime_ns, facts.st_size
