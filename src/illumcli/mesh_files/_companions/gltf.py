"""The files that a glTF file may name."""

from __future__ import annotations

import json
import re
from pathlib import Path

from illumcli.mesh_files._companions import files_named

_URI = re.compile(rb'"uri"\s*:\s*"([^"]{1,4096})"')


def companions(path: Path) -> list[Path]:
    """The buffers and images that a file may name."""
    return files_named(path, lambda data: [_unescaped(uri) for uri in _URI.findall(data)])


def _unescaped(uri: bytes) -> bytes:
    """A JSON string with its escapes decoded."""
    try:
        return str(json.loads(b'"' + uri + b'"', strict=False)).encode("utf-8", "replace")
    except ValueError:
        return uri
