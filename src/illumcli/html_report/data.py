"""The data of a report as a script, and the content hashes in it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from illumcli import __version__
from illumcli.files.seal import BLANK, sealed_text
from illumcli.html_report.columns import measures_of, parameters_of
from illumcli.html_report.entries import Contents, Entry, Picture

_BEGIN = "const REPORT = "


def data_script(contents: Contents, folder: Path) -> str:
    """A script with the constant REPORT, sealed; `folder` is where it will be.

    Its text is ASCII. Names that come from outside are values in it, never keys.
    """
    entries = contents.entries
    names = list(dict.fromkeys(name for entry in entries for name in entry.pictures))
    data: dict[str, Any] = {
        "illum": __version__,
        "title": contents.title,
        "noun": contents.noun,
        "seconds": contents.seconds,
        "ratio": contents.ratio,
        "parameters": [
            {"path": each.path, "label": each.label, "numeric": each.is_numeric}
            | {"values": each.values, "texts": each.texts, "at": each.at}
            for each in parameters_of(contents)
        ],
        "measures": [{"name": each.name, "values": each.values} for each in measures_of(contents)],
        "labels": [entry.label for entry in entries],
        "states": [entry.state for entry in entries],
        "errors": [entry.error for entry in entries],
        "commands": [entry.command for entry in entries],
        "pictureNames": names,
        "pictures": [[_identity(entry.pictures.get(name)) for name in names] for entry in entries],
        "files": [[_address(entry, name, folder) for name in names] for entry in entries],
        "references": [_identity(entry.reference) for entry in entries],
        "contents": [entry.content for entry in entries],
    }
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return sealed_text(f"// {BLANK}\n{_BEGIN}{text};\n")


def data_contents(path: Path) -> Sequence[str]:
    """The content hashes of the entries in such a script.

    Raises
    ------
    KeyError, TypeError, ValueError
        A file of another program.
    """
    contents: list[str] = _stored(path)["contents"]
    return contents


def data_pictures(path: Path) -> set[str]:
    """The identities of all pictures that such a script names."""
    data = _stored(path)
    named = {identity for of_entry in data["pictures"] for identity in of_entry}
    return (named | set(data["references"])) - {None}


def _stored(path: Path) -> dict[str, Any]:
    _, _, text = path.read_text(encoding="utf-8").partition(_BEGIN)
    data: dict[str, Any] = json.loads(text.rstrip().removesuffix(";"))
    return data


def _identity(picture: Picture | None) -> str | None:
    return None if picture is None else picture.identity


def _address(entry: Entry, name: str, folder: Path) -> str | None:
    """The address of a picture's own file, relative to the report."""
    if name not in entry.pictures:
        return None
    relative = os.path.relpath(entry.pictures[name].path, folder)
    return quote(relative.replace(os.sep, "/"))
