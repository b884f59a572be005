"""Where the workers of a cluster are: `local[:N]`, the address of a scheduler, or its file."""

from __future__ import annotations

import os
import re
from pathlib import Path

from illumcli.errors import InputError
from illumcli.records import Value

MOST_LOCAL = 1024


class Address(Value):
    """A cluster: one that is started here, or a scheduler that runs already."""

    local: int = 0
    """Number of worker processes to start on this machine; 0 for a scheduler."""
    scheduler: str = ""
    """`tcp://HOST:PORT` or `tls://HOST:PORT`."""
    file: Path | None = None
    """The scheduler's file, which names its address."""


def address_of(text: str) -> Address:
    """The cluster that `--cluster` names.

    Raises
    ------
    InputError
    """
    if match := re.fullmatch(r"local(?::(\d{1,9}))?", text):
        count = int(match[1]) if match[1] else len(os.sched_getaffinity(0))
        if not 1 <= count <= MOST_LOCAL:
            raise InputError(f"--cluster {text}: start from 1 to {MOST_LOCAL} workers")
        return Address(local=count)
    if (match := re.fullmatch(r"(?:tcp|tls)://[^/]+:(\d{1,5})", text)) and 0 < int(match[1]) < 65536:
        return Address(scheduler=text)
    if "://" in text:
        raise InputError(f"--cluster {text}: write tcp://HOST:PORT or tls://HOST:PORT")
    if not Path(text).is_file():
        fact = "no such file"
        raise InputError(
            f"--cluster {text}: {fact}; write local, local:N, tcp://HOST:PORT, or a scheduler's file"
        )
    return Address(file=Path(text))
