"""Names of other files in the text of a mesh file, found without reading the mesh."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from illumcli.errors import IllumError, InputError
from illumcli.mesh_files._files import LONGEST_NAME, beside, content
from illumcli.mesh_files._text import decoded, without_comment

MOST_WORDS = 128  # of a line that names files, with the blanks between them


def files_named(
    path: Path,
    find: Callable[[bytes], list[bytes]],
    folder: Path | None = None,
    most: int | None = None,
) -> list[Path]:
    """The paths inside `folder` that the text of a file may mean.

    Parameters
    ----------
    find
        From the file's bytes, its first `most`, to the texts that name files.
    folder
        That of `path` by default.
    """
    folder = folder or path.parent
    try:
        data = content(path, most)
    except IllumError:  # whoever reads the file says what is wrong with it
        return []
    names = dict.fromkeys(name for text in find(data) for name in _meanings(text))
    files: dict[Path, None] = {}
    for name in names:
        for start in (path, folder / path.name):
            with suppress(InputError):
                files[beside(start, name, str(path), folder)] = None
    return list(files)


def _meanings(text: bytes) -> Iterator[str]:
    """The names that may be meant: all of it, what follows any word, each word; with folders and without."""
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
