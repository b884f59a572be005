"""Files of BRDFs: written all, or none if another file is in the place of one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from illumcli.errors import OutputError
from illumcli.files.atomic import os_errors_as_output_errors, write_bytes
from illumcli.files.outputs import refresh, refuse_empty_link


def write_files(files: Mapping[Path, bytes], force: bool) -> list[Path]:
    """Write the files. Returns those that are kept because they have the same bytes.

    Raises
    ------
    OutputError
        A different file exists and `force` is False; then none is written.
    """
    # Refuse different files before any is written.
    kept = []
    for path, data in files.items():
        with os_errors_as_output_errors(str(path)):
            if not force and path.is_file():
                if path.read_bytes() != data:
                    fact = "a different file is there; use --force to replace it, or another name"
                    raise OutputError(f"{path}: {fact}")
                kept.append(path)
            elif not force:
                refuse_empty_link(path)
    for path, data in files.items():
        if path in kept:
            refresh(path)
        else:
            write_bytes(path, data)
    return kept
