"""File names from patterns with fields: expanded, safe for file systems, and unique."""

from __future__ import annotations

import math
import os
import re
import unicodedata
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from illumcli.errors import InputError
from illumcli.schema.messages import suggestion

LONGEST_NUMBER = 20
"""Characters of a number in a name."""
LONGEST = 4096
"""Letters of a path that no system exceeds."""
_FIELD = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}:]*)(?::(?P<form>[^{}]*))?\}|[{}]")


def expand(pattern: str, values: Mapping[str, Any]) -> str:
    """`pattern` with every field replaced by its value.

    A field is `{name}` or `{name:form}`. The name may contain dots, as in `{materials.clay.sigma}`; the form
    is that of Python's `format`. File names with numbers sort correctly only if these are padded:
    `{frame:04d}` turns 7 into 0007 and keeps 10,000 frames in order. `{{` and `}}` are literal braces. Values
    never add folders: all characters except letters, digits and ``. _ + -`` become `_`, and so do dots at
    their ends.

    Raises
    ------
    InputError
        All faults of the pattern: a lone brace, a field that is not among `values`, a form that does not fit
        its value or is wider than any name, a NUL.
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

    # `value` collects the faults, so that one error lists all of them.
    name = _FIELD.sub(value, pattern)
    if len(name) > LONGEST and not problems:
        problems.append(f"{shown}: makes a name of {len(name)} letters; no system takes more than {LONGEST}")
    if problems:
        raise InputError(problems)
    return name


def with_forms(pattern: str, forms: Mapping[str, str]) -> str:
    """`pattern` with a form for each of its fields that has none, if `forms` has one."""

    def formed(field: re.Match[str]) -> str:
        name = field["name"]
        is_bare = name is not None and field["form"] is None
        return f"{{{name}:{forms[name]}}}" if is_bare and forms.get(name) else field[0]

    return _FIELD.sub(formed, pattern)


def number_form(values: Sequence[int | float]) -> str:
    """The form in which all of some numbers have the same width, so that names with those from 0 on sort.

    Whole numbers have all their digits, others as many decimals as they need, but not more than make four
    digits that count of each: a third is 0.3333. Numbers that would be too long, or equal, have no form.
    """
    if all(isinstance(value, int) for value in values):
        return f"0{max(len(str(value)) for value in values)}d"
    decimals = max(map(_decimals, values))
    texts = [f"{value:.{decimals}f}" for value in values]
    while len(set(texts)) < len(set(values)) and decimals < LONGEST_NUMBER:
        decimals += 1
        texts = [f"{value:.{decimals}f}" for value in values]
    width = max(map(len, texts))
    return f"0{width}.{decimals}f" if width <= LONGEST_NUMBER else ""


def _decimals(value: float) -> int:
    """The decimals with which a number is exact, or has four digits that count."""
    if value == 0:
        return 0
    most = max(0, 3 - math.floor(math.log10(abs(value))))
    return next((count for count in range(most) if float(f"{value:.{count}f}") == value), most)


def frame_field(frames: Sequence[int]) -> str:
    """The part of a pattern that names frames, with at least four digits; empty without frames."""
    return f".{{frame:0{max(4, len(str(max(frames))))}d}}" if frames else ""


def expand_some(pattern: str, values: Mapping[str, Any]) -> str:
    """`pattern` with those fields replaced that are among `values`; the others stay."""
    return _FIELD.sub(
        lambda match: expand(match[0], values) if match["name"] in values else match[0], pattern
    )


def fields(pattern: str) -> set[str]:
    """The names of the fields in `pattern`."""
    return {match["name"] for match in _FIELD.finditer(pattern) if match["name"] is not None}


def check_unique(names: Sequence[str], inputs: Sequence[str] | None = None) -> None:
    """Raise InputError if two of `names` are the same file, possibly on file systems that ignore case.

    Parameters
    ----------
    inputs : sequence of str, optional
        What each file is computed from, to name in messages; by default they number images from 1.

    Raises
    ------
    InputError
        Every such name, with its inputs or the numbers of its images.
    """
    # Images by name, ignoring case.
    images = defaultdict(list)
    normal = [unicodedata.normalize("NFC", os.path.normpath(name)) for name in names]
    for number, name in enumerate(normal, 1):
        images[name.casefold()].append(number)

    # A message for each name of several images.
    problems = []
    for same in images.values():
        if len(same) > 1:
            each_of = [str(number) if inputs is None else inputs[number - 1] for number in same]
            listed = ", ".join(each_of[:5]) + (", ..." if len(same) > 5 else "")
            what = f"{len(same)} images ({listed})" if inputs is None else f"the outputs of {listed}"
            advice = "add a field to the pattern in which they differ"
            if inputs is not None:
                advice = "write {name} into the pattern, or give the inputs names that differ"
            if len({normal[number - 1] for number in same}) == len(same):
                advice = "they differ only in case, which some file systems ignore; rename one of them"
            problems.append(f"{names[same[0] - 1]}: the name of {what}; {advice}")
    if problems:
        raise InputError(problems)


def _safe(text: str) -> str:
    """`text` as a part of a file name that is valid on any system; never empty, never a folder."""
    text = re.sub(r"[^\w.+-]+", "_", text)
    return re.sub(r"^\.+|\.+$", "_", text) or "_"


def band_path(picture: Path, rows: tuple[int, int]) -> Path:
    """The file of some rows of a picture, from the first to before the second."""
    return picture.with_name(f"{picture.stem}.rows-{rows[0]:05d}-{rows[1] - 1:05d}{picture.suffix}")


def rows_of_band_files(picture: Path) -> list[tuple[int, int]]:
    """The rows of each file beside a picture that has the name of a band of it."""
    stem, suffix = re.escape(picture.stem), re.escape(picture.suffix)
    name = re.compile(rf"{stem}\.rows-(0\d{{4}}|[1-9]\d{{4,}})-(0\d{{4}}|[1-9]\d{{4,}}){suffix}")
    matches = [name.fullmatch(entry) for entry in os.listdir(picture.parent)]
    return [(int(match[1]), int(match[2]) + 1) for match in matches if match]
