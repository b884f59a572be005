"""The files that a mesh file may name: one module for each format that names any, called as the format.

Each has `companions(path)`. They are imported without the formats: a mesh in the cache is not read, but the
files beside it are part of its identity.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from illumcli.errors import IllumError, InputError
from illumcli.mesh_files._files import LONGEST_NAME, beside, content
from illumcli.mesh_files._words import decoded, without_comment

MOST_WORDS = 128  # words considered in a line that names files, blanks between them included


def files_named(
    path: Path,
    find: Callable[[bytes], list[bytes]],
    folder: Path | None = None,
    most: int | None = None,
) -> list[Path]:
    """The paths inside `folder` that a file may refer to.

    Parameters
    ----------
    find
        Function of the file's bytes, or the first `most`: the texts that name files.
    folder
        By default that of `path`.
    """
    folder = folder or path.parent
    try:
        data = content(path, most)
    except IllumError:  # reported when the file is read
        return []
    names = dict.fromkeys(name for text in find(data) for name in _meanings(text))
    files: dict[Path, None] = {}
    for name in names:
        for start in (path, folder / path.name):
            with suppress(InputError):
                files[beside(start, name, str(path), folder)] = None
    return list(files)


def _meanings(text: bytes) -> Iterator[str]:
    """All possible file names in a text: the whole, the rest after each word, each word; also without
    folders."""
    line = decoded(text[:LONGEST_NAME]).strip()
    if line.startswith("data:"):
        return
    words = re.split(r"(\s+)", line)
    tails = ("".join(words[k:]) for k in range(0, min(len(words), MOST_WORDS), 2))
    for name in (*tails, *words[:MOST_WORDS:2]):
        for each in (name, unquote(name), without_comment(name).rstrip(), name.strip("\"'")):
            if each and "\0" not in each:
                yield each
                yield PureWindowsPath(each).name
