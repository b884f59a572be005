"""Pictures that commands of the site draw: each is drawn again only when what it depends on has changed."""

from __future__ import annotations

import contextlib
import hashlib
import io
import shlex
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import illumcli
from illumcli.cli import illum

SOURCE = Path(illumcli.__file__).parent
GREY = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000002000000010800000000d149205600"
    "00000b49444154789c636868000001830101183522150000000049454e44ae426082"
)
"""A picture of two grey pixels."""


class Drawing(NamedTuple):
    """A picture, and the command on its page that draws it."""

    file: str
    command: str
    depends: str
    """Hash of what the picture depends on beside the command."""

    @property
    def key(self) -> str:
        """Hash of all that the picture depends on."""
        return hashlib.blake2b(f"{self.command}\n{self.depends}".encode(), digest_size=16).hexdigest()


def digest_of(files: Iterable[Path]) -> str:
    """Hash of the content of files."""
    content = b"".join(path.read_bytes() for path in sorted(files))
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def draw(drawings: Sequence[Drawing], folder: Path, draft: bool) -> dict[str, bytes]:
    """File -> content of pictures, which are kept below a folder by their keys.

    For a draft, commands write tables of numbers, and the pictures are grey.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if draft:
        for each in drawings:
            words = shlex.split(each.command)[1:]
            run([*words[: words.index("-o")], "--csv", str(folder / "draft.csv"), "--force"])
        return dict.fromkeys((each.file for each in drawings), GREY)
    missing = [each for each in drawings if not kept(each, folder).exists()]
    with ProcessPoolExecutor(max_workers=2) as pool:
        list(pool.map(_draw, missing, [folder] * len(missing)))
    return {each.file: kept(each, folder).read_bytes() for each in drawings}


def kept(drawing: Drawing, folder: Path) -> Path:
    """Where a picture is kept."""
    return folder / f"{drawing.key}{Path(drawing.file).suffix}"


def _draw(drawing: Drawing, folder: Path) -> None:
    """Run the command of a picture."""
    words = shlex.split(drawing.command)[1:]
    words[words.index("-o") + 1] = str(kept(drawing, folder))
    run(words)


def run(words: Sequence[str]) -> None:
    """Run a command, whose output is the picture alone."""
    with contextlib.redirect_stdout(io.StringIO()):
        illum.main([*words, "-q"], standalone_mode=False)
