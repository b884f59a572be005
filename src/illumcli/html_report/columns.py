"""The columns of a report: parameters that vary, and measures, with the values of all variants."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from illumcli.html_report.entries import Contents, Entry
from illumcli.records import Value
from illumcli.scene.variants import number_in, short_numbers


class Parameter(Value):
    """A path that has several values."""

    path: str
    label: str
    """The shortest end of the path that no other parameter shares."""
    values: tuple[str, ...]
    """Every value once: numbers in their order, others as they come first."""
    texts: tuple[str, ...]
    """The values as they are shown: numbers with as few digits as tell them apart."""
    at: tuple[int, ...]
    """For each variant the index of its value; -1 if it has none."""
    is_numeric: bool


class Measure(Value):
    """A measured quantity."""

    name: str
    values: tuple[float | None, ...]
    """For each variant; None where it was not measured."""

    @property
    def limits(self) -> tuple[float, float] | None:
        """Smallest and largest value; None if there is none."""
        known = [value for value in self.values if value is not None]
        return (min(known), max(known)) if known else None

    @property
    def varies(self) -> bool:
        """True if it has several values."""
        return self.limits is not None and self.limits[0] < self.limits[1]


def parameters_of(contents: Contents) -> list[Parameter]:
    """The parameters of a report, in the order of the entries' values."""
    entries = contents.entries
    paths = dict.fromkeys(path for entry in entries for path in entry.values)
    values_of = [(path, _distinct(entries, path)) for path in paths]
    varying = [(path, values) for path, values in values_of if len(values) > 1]
    labels = short_labels([path for path, _ in varying])
    return [
        _parameter(path, label, values, entries)
        for (path, values), label in zip(varying, labels, strict=True)
    ]


def measures_of(contents: Contents) -> list[Measure]:
    """The measures of a report, in the order of the entries' own."""
    names = dict.fromkeys(name for entry in contents.entries for name in entry.measures)
    return [
        Measure(name, tuple(_finite(entry.measures.get(name)) for entry in contents.entries))
        for name in names
    ]


def short_labels(paths: Sequence[str]) -> list[str]:
    """For each path its shortest end, in whole parts, that is no end of another."""
    ends = Counter(end for path in paths for end in set(_ends(path)))
    return [next((end for end in _ends(path) if ends[end] == 1), path) for path in paths]


def _ends(path: str) -> list[str]:
    parts = path.split(".")
    return [".".join(parts[k:]) for k in reversed(range(len(parts)))]


def _distinct(entries: Sequence[Entry], path: str) -> tuple[str, ...]:
    """Every value of a path once; a path that some entries lack has the value "" there."""
    return tuple(dict.fromkeys(entry.values.get(path, "") for entry in entries))


def _parameter(path: str, label: str, values: tuple[str, ...], entries: Sequence[Entry]) -> Parameter:
    values = tuple(value for value in values if value)
    numbers = [number_in(value) for value in values]
    if is_numeric := all(number is not None for number in numbers):
        values = tuple(sorted(values, key=float))
    index = {value: k for k, value in enumerate(values)}
    at = tuple(index.get(entry.values.get(path, ""), -1) for entry in entries)
    texts = short_numbers(values) if is_numeric else values
    return Parameter(path, label, values, texts, at, is_numeric)


def _finite(number: float | None) -> float | None:
    return number if number is not None and math.isfinite(number) else None
