"""The folder of a report.

index.html      the page
data.js         all that it says, sealed; the last file to be written
assets/         style sheet and scripts, the same for all reports
pictures/       two files of each picture, named by its content: what exists is not made again
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from importlib.resources import files
from pathlib import Path

from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import write_bytes, write_text
from illumcli.files.outputs import is_kept, refuse_unwritable
from illumcli.html_report.data import data_contents, data_pictures, data_script
from illumcli.html_report.entries import PAGE, Contents
from illumcli.html_report.page import GENERATOR, page
from illumcli.html_report.picture_files import picture_files, write_picture

_PICTURE_FILE = re.compile(r"[0-9a-f]{32}\.(js|jpg)")
_HEAD = 1 << 12  # bytes of a page that name the program that made it


def is_report_kept(folder: Path, contents: Sequence[str], force: bool) -> bool:
    """True if the folder holds the report of these variants, complete; see `files.outputs.is_kept`.

    Raises
    ------
    InputError
        jinja2 is missing.
    OutputError
        The folder cannot be written, or holds another report or page and `force` is False.
    """
    try:
        import jinja2  # noqa: F401
    except ImportError:
        fact = "--html needs jinja2; install it: pip install 'illumcli[html]', or leave --html out"
        raise InputError(fact) from None
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: is a file; give the name of a folder")
    index = folder / PAGE
    if index.is_file() and not force and not _is_ours(index):
        raise OutputError(f"{index}: a page of another program is there; use --force, or another folder")
    for path in _other_files(folder, ["0" * 32]):
        refuse_unwritable(path)
    data = folder / "data.js"
    if not is_kept(data, contents, data_contents, force):
        return False
    return all(path.is_file() for path in _other_files(folder, data_pictures(data)))


def write_report(folder: Path, contents: Contents) -> None:
    """Write a report; the files of pictures that it does not show are removed.

    Raises
    ------
    OutputError
        A file cannot be written, or a picture was removed.
    """
    # Pictures first: an interrupted report is continued from those that exist.
    pictures = folder / "pictures"
    shown = {picture.identity: picture for entry in contents.entries for picture in entry.files}
    for picture in shown.values():
        try:
            write_picture(pictures, picture)
        except InputError as error:
            fact = "was written, but cannot be read any more; run the command again"
            raise OutputError(f"{picture.path}: {fact}") from error

    # The page, then what it says.
    for target, data in _assets(folder):
        write_bytes(target, data)
    write_text(folder / PAGE, page(contents))
    write_text(folder / "data.js", data_script(contents, folder))

    # Remove pictures of an earlier report.
    for path in pictures.glob("*"):
        if _PICTURE_FILE.fullmatch(path.name) and path.stem not in shown:
            with suppress(OSError):
                path.unlink()


def _is_ours(index: Path) -> bool:
    with index.open("rb") as file:
        return GENERATOR.encode() in file.read(_HEAD)


def _other_files(folder: Path, identities: Iterable[str]) -> list[Path]:
    """All files of a report with these pictures, but its data."""
    files = [folder / PAGE, *(path for path, _ in _assets(folder))]
    return files + [path for identity in identities for path in picture_files(folder / "pictures", identity)]


def _assets(folder: Path) -> list[tuple[Path, bytes]]:
    """Path and bytes of each style sheet and script."""
    return [
        (folder / "assets" / asset.name, asset.read_bytes())
        for asset in sorted((files("illumcli.html_report") / "assets").iterdir(), key=lambda each: each.name)
    ]
