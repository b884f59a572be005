"""The files that a PLY file may name."""

from __future__ import annotations

import re
from pathlib import Path

from illumcli.mesh_files._companions import files_named

LONGEST_HEADER = 1 << 20  # [bytes]
END = re.compile(rb"[\r\n][ \t]*end_header[ \t]*(\r\n|\n|\r)")
_TEXTURE = re.compile(rb"comment[ \t]+texturefile[ \t]([^\r\n]*)", re.IGNORECASE)


def companions(path: Path) -> list[Path]:
    """The images that a PLY may name."""
    return files_named(path, lambda data: _TEXTURE.findall(head(data)), most=LONGEST_HEADER)


def head(data: bytes) -> bytes:
    """The lines of a header before its end; all bytes if it has none."""
    end = END.search(data, 0, LONGEST_HEADER)
    return data if end is None else data[: end.start()]
