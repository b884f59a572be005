"""The file names of an image set: a pattern with fields, filled in, safe and unique."""

from __future__ import annotations

import os
import re
import unicodedata
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from illumcli.errors import InputError
from illumcli.schema.messages import suggestion

LONGEST = 4096
"""Letters of a path; no system takes more."""
_FIELD = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}:]*)(?::(?P<form>[^{}]*))?\}|[{}]")


def expand(pattern: str, values: Mapping[str, Any]) -> str:
    """`pattern` with every field replaced by its value.

    A field is `{name}` or `{name:form}`; the name may hold dots, as `{materials.clay.sigma}`, the form is
    that of Python's `format`. Numbers sort as names only when they are padded: `{frame:04d}` makes 0007 of 7
    and keeps 10,000 frames in order. `{{` and `}}` stand for braces. Folders come from the pattern alone: in
    a value all but letters, digits and ``. _ + -`` becomes `_`, and so do dots at its ends.

    Raises
    ------
    InputError
        All that is wrong with the pattern: a lone brace, a field that is not among `values`, a form that does
        not suit its value or is wider than any name, a NUL.
    """
    problems: list[str] = []
    shown = pattern if len(pattern) <= 80 else f"{pattern[:80]}..."
    if "\0" in pattern:
        problems.append(f"{shown}: character U+0000 is no part of any name; take it out")

    def value(field: re.Match[str]) -> str:
        if field[0] in ("{{", "}}"):
            return field[0][0]
        name = field["name"]
        if name is None:
            place = f"lone '{field[0]}' at character {field.start() + 1}"
            problems.append(f"{shown}: {place}; write '{field[0] * 2}' for a brace")
        elif name not in values:
            problems.append(f"{shown}: no field '{name}'; {suggestion(name, tuple(values))}")
        elif re.search(r"[1-9]\d{3}", form := field["form"] or ""):
            problems.append(f"{shown}: '{form}' makes {name} longer than any name; use a form as 04d or .3f")
        else:
            try:
                return _safe(format(values[name], form))
            except (TypeError, ValueError):
                fact = f"'{form}' does not fit {name} = {values[name]!r}"
                problems.append(f"{shown}: {fact}; leave it out or use a form of its kind, as 04d or .3f")
        return ""

    name = _FIELD.sub(value, pattern)
    if len(name) > LONGEST and not problems:
        problems.append(f"{shown}: makes a name of {len(name)} letters; no system takes more than {LONGEST}")
    if problems:
        raise InputError(problems)
    return name


def fields(pattern: str) -> set[str]:
    """The names of the fields in `pattern`."""
    return {match["name"] for match in _FIELD.finditer(pattern) if match["name"] is not None}


def check_unique(names: Sequence[str]) -> None:
    """Nothing, where each of `names` is a file of its own, on file systems that ignore case too.

    Raises
    ------
    InputError
        Every name that several images would have, and which images, counted from 1.
    """
    images = defaultdict(list)
    normal = [unicodedata.normalize("NFC", os.path.normpath(name)) for name in names]
    for number, name in enumerate(normal, 1):
        images[name.casefold()].append(number)
    problems = []
    for same in images.values():
        if len(same) > 1:
            listed = ", ".join(map(str, same[:5])) + (", ..." if len(same) > 5 else "")
            advice = "put a field that tells them apart into the pattern"
            if len({normal[number - 1] for number in same}) == len(same):
                advice = "they differ in case alone, which some file systems ignore; rename one of them"
            problems.append(f"{names[same[0] - 1]}: the name of {len(same)} images ({listed}); {advice}")
    if problems:
        raise InputError(problems)


def _safe(text: str) -> str:
    """`text` as part of a file name on any system; never empty, never a folder."""
    text = re.sub(r"[^\w.+-]+", "_", text)
    return re.sub(r"^\.+|\.+$", "_", text) or "_"
