"""Reads reference vectors: cases of inputs, expected values and tolerances, from JSON.

A file is a list of objects with the keys ``id, model, inputs, expected, rtol, atol``; the keys ``source``,
``note`` and ``quantity`` are documentation. `model` is the case type. Directions in `inputs` need not have
unit length. Where `inputs` has `parameters`, `model` is the tag of an illumination model, and `expected` its
response in R, G, B under white light. A result x passes if max_i |x_i - e_i| <= atol + rtol * max_i |e_i|.
"""

from __future__ import annotations

import gzip
import json
import lzma
from collections.abc import Callable, Collection, Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.records import Record
from illumcli.schema.messages import suggestion

PACKAGED = Path(str(files("illumcli"))) / "data" / "vectors"
"""The vectors of the package, with 50 digits: a file of the textbooks' models, and one per later model."""

KEYS = ("id", "model", "inputs", "expected", "rtol", "atol")
MAX_SHOWN = 10
"""Most problems or cases in a message."""
MAX_BYTES = 1 << 28
"""Largest unpacked size of a file."""
OPENERS: dict[str, Callable[..., Any]] = {".xz": lzma.open, ".gz": gzip.open}


class Case(Record):
    """A set of inputs with the expected values."""

    id: str
    type: str
    inputs: Mapping[str, Any]
    expected: NDArray[np.float64]  # (k,)
    rtol: float
    atol: float

    @property
    def scale(self) -> float:
        """max |e_i|, the denominator of relative errors; 1 if all expected values are 0."""
        return float(np.abs(self.expected).max()) or 1.0

    @property
    def allowed(self) -> float:
        """The largest deviation that passes."""
        return self.atol + self.rtol * float(np.abs(self.expected).max())


def read_cases(
    path: Path, known: Collection[str], only: Collection[str] = (), may_lack: Collection[str] = ()
) -> list[Case]:
    """The cases of a vectors file (`.json`, also `.xz` or `.gz`), in its order, or of a folder of them.

    Parameters
    ----------
    known : collection of str
        Case types that have an evaluator.
    only : collection of str
        Keep these types alone; by default all.
    may_lack : collection of str
        Types of `only` that need no case.

    Raises
    ------
    InputError
        The file cannot be read, a case is malformed, a type is unknown or has no case: all of it at once.
    """
    table = sorted(known)
    unknown = [
        f"--only {name}: no such case type; {suggestion(name, tuple(table))}"
        for name in only
        if name not in known
    ]
    if unknown:
        raise InputError(unknown)
    problems: list[str] = []
    cases: list[Case] = []
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        entries = _entries(file)
        found = [_case(file, number, entry, problems) for number, entry in enumerate(entries, 1)]
        wanted = [case for case in found if case is not None and (not only or case.type in only)]
        problems += _unknown(file, wanted, table)
        cases += wanted
        if not entries:
            problems.append(f"{file}: holds no case")
    missing = set(only) - {case.type for case in cases} - set(may_lack)
    problems += [f"{path}: holds no case of type '{name}'" for name in sorted(missing) if not problems]
    if problems:
        raise InputError(_shortened(path, problems))
    return cases


def _entries(path: Path) -> list[Any]:
    try:
        with OPENERS.get(path.suffix, open)(path, "rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise LimitError(f"{path}: more than {MAX_BYTES >> 20} MiB of text; check its cases in parts")
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start})") from None
    except (OSError, EOFError, lzma.LZMAError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        entries = json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}:{error.colno}: is not JSON: {error.msg}") from None
    except _NotFiniteError as error:
        raise InputError(f"{path}: holds {error}, which is not a number of JSON") from None
    if not isinstance(entries, list):
        raise InputError(f"{path}: must be a list of cases, is {_kind(entries)}")
    return entries


class _NotFiniteError(ValueError):
    """NaN or Infinity in the text."""


def _refused(word: str) -> float:
    raise _NotFiniteError(word)


def _case(path: Path, number: int, entry: Any, problems: list[str]) -> Case | None:
    """The case of one entry; None if it is malformed, which is added to `problems`."""
    place = f"{path}: case {number}"
    if not isinstance(entry, dict):
        problems.append(f"{place}: must be an object, is {_kind(entry)}")
        return None
    # Messages name the case by its id as well, where it has one.
    if isinstance(entry.get("id"), str):
        place += f" ({entry['id']})"
    missing = [key for key in KEYS if key not in entry]
    if missing:
        problems.append(f"{place}: lacks {', '.join(missing)}")
        return None
    # All wrong values of the entry are reported at once.
    values = entry["expected"] if isinstance(entry["expected"], list) else [entry["expected"]]
    wrong = [
        f"{place}: {key}: must be {kind}, is {_kind(entry[key])}"
        for key, kind, good in (
            ("id", "text", isinstance(entry["id"], str)),
            ("model", "text", isinstance(entry["model"], str)),
            ("inputs", "an object", isinstance(entry["inputs"], dict)),
            ("expected", "a number or a list of numbers", bool(values) and all(map(_is_number, values))),
            ("rtol", "a number of at least 0", _is_number(entry["rtol"]) and entry["rtol"] >= 0),
            ("atol", "a number of at least 0", _is_number(entry["atol"]) and entry["atol"] >= 0),
        )
        if not good
    ]
    if wrong:
        problems.extend(wrong)
        return None
    expected = np.array(values, np.float64)
    return Case(
        entry["id"], entry["model"], entry["inputs"], expected, float(entry["rtol"]), float(entry["atol"])
    )


def _unknown(path: Path, cases: Iterable[Case], known: list[str]) -> list[str]:
    by_type: dict[str, list[str]] = {}
    for case in cases:
        if case.type not in known:
            by_type.setdefault(case.type, []).append(case.id)
    return [
        f"{path}: no case type '{name}' ({shorten(ids, MAX_SHOWN)}); {suggestion(name, tuple(known))}"
        for name, ids in by_type.items()
    ]


def shorten(names: list[str], count: int) -> str:
    """The first `count` names, and the number of further ones."""
    more = f" and {len(names) - count} more" if len(names) > count else ""
    return ", ".join(names[:count]) + more


def _shortened(path: Path, problems: list[str]) -> list[str]:
    if len(problems) <= MAX_SHOWN:
        return problems
    return [*problems[:MAX_SHOWN], f"{path}: {len(problems) - MAX_SHOWN} more problems"]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _kind(value: Any) -> str:
    names = {dict: "an object", list: "a list", str: f"the text '{value}'", type(None): "null"}
    return names.get(type(value), str(value))
