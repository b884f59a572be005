"""pydantic's errors in the words of a scene file: which part, and what is wrong with it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic_core import ValidationError

from illumcli.scene.source import Path, short
from illumcli.schema.description import Description
from illumcli.schema.families import suggestion

Fault = tuple[Path, str]  # which part, what is wrong


def faults(error: ValidationError, tree: Any, classes: Mapping[int, type[Description]]) -> Iterator[Fault]:
    """Each fault once, in the order of the fields.

    Parameters
    ----------
    error : ValidationError
    tree
        What was validated: dicts, lists and scalars.
    classes : mapping
        The description that each faulty mapping of `tree` was read as, by `id` (`Description` notes it in
        the validation's context).
    """
    return iter(dict.fromkeys(_faults(error, tree, classes)))


def _faults(error: ValidationError, tree: Any, classes: Mapping[int, type[Description]]) -> Iterator[Fault]:
    lengths = _short_lists(error, tree)
    for fault in error.errors(include_url=False):
        kind, loc = fault["type"], fault["loc"]
        if kind == "missing":
            path, name = written(loc[:-1], tree), loc[-1]
            if isinstance(name, str):
                yield path, f"missing key '{name}'"
            elif path in lengths:
                yield path, _length(lengths.pop(path), part_at(path, tree))
        elif kind == "extra_forbidden":
            path, name = written(loc, tree), str(loc[-1])
            owner = classes.get(id(part_at(path[:-1], tree)))
            way = f"; {suggestion(name, tuple(owner.fields()))}" if owner else ""
            yield path, f"unknown key '{short(name)}'{way}"
        elif kind != "too_short" or len(fault["input"]) < fault["ctx"]["min_length"]:
            yield written(loc, tree), fact(kind, fault["input"], fault.get("ctx", {}), fault["msg"])


def fact(kind: str, value: Any, facts: Mapping[str, Any], said: str) -> str:
    """What is wrong with `value`, which pydantic calls `kind` and describes by `facts` and `said`."""
    if kind in _WORDS:
        return _WORDS[kind](value, facts)
    if kind in _TYPES:
        return f"must be {_TYPES[kind]}, is {shown(value)}"
    return said.removeprefix("Value error, ")


def shown(value: Any) -> str:
    """A value as a message names it."""
    match value:
        case None:
            return "empty"
        case bool():
            return str(value).lower()
        case str():
            return f"text '{short(value)}'"
        case dict():
            return "a mapping"
        case list() | tuple():
            return "a list"
        case _:
            return short(repr(value))


def written(loc: tuple[str | int, ...], tree: Any) -> Path:
    """The parts of `loc` that stand in the file; the rest are the names of a union's choices."""
    path: list[str | int] = []
    for i, step in enumerate(loc):
        inside = part_at((step,), tree)
        # `texture` is a key and also names the choice that this key selects
        choice = not isinstance(inside, dict | list) and any(
            part_at((s,), tree) is not _NOTHING for s in loc[i + 1 :]
        )
        if inside is not _NOTHING and not choice:
            path.append(step)
            tree = inside
    return tuple(path)


def part_at(path: Path, tree: Any) -> Any:
    """The part of `tree` at `path`; a value equal to nothing else where there is none."""
    for step in path:
        inside = step in tree if isinstance(tree, dict) else isinstance(step, int) and step < _count(tree)
        if not inside:
            return _NOTHING
        tree = tree[step]
    return tree


def _count(tree: Any) -> int:
    return len(tree) if isinstance(tree, list | tuple) else 0


_NOTHING = object()


def _short_lists(error: ValidationError, tree: Any) -> dict[Path, int]:
    """Lists with too few parts, and how many they need: pydantic names each missing one."""
    lengths: dict[Path, int] = {}
    for fault in error.errors(include_url=False, include_context=False, include_input=False):
        *above, last = fault["loc"] or ("",)
        if fault["type"] == "missing" and isinstance(last, int):
            path = written(tuple(above), tree)
            lengths[path] = max(last + 1, lengths.get(path, 0))
    return lengths


def _length(count: int, value: Any) -> str:
    numbers = " numbers" if value and all(isinstance(part, int | float) for part in value) else ""
    return f"must be a list of {count}{numbers}, has {len(value)}"


def _bound(words: str, limit: str) -> Callable[[Any, Mapping[str, Any]], str]:
    return lambda value, facts: f"must be {words} {facts[limit]:g}, is {shown(value)}"


def _choice(value: Any, facts: Mapping[str, Any]) -> str:
    known = tuple(re.findall(r"'([^']*)'", facts["expected"]))
    if known and isinstance(value, str):
        return f"no choice '{short(value)}'; {suggestion(value, known)}"
    return f"must be {facts['expected']}, is {shown(value)}"


def _color(value: Any, facts: Mapping[str, Any]) -> str:
    own = f"a list of {len(value)}" if isinstance(value, list | tuple) else shown(value)
    return f"must be {COLOR}, is {own}"


def _ambient(value: Any, facts: Mapping[str, Any]) -> str:
    return f"must be {COLOR}, or a form (separate, coupled), is {shown(value)}"


COLOR = "one number, three numbers or '#rrggbb' in quotes"


def _tag(value: Any, facts: Mapping[str, Any]) -> str:
    known, tag = tuple(re.findall(r"'([^']*)'", facts["expected_tags"])), str(facts["tag"])
    return f"no {facts['discriminator'][1:-1]} '{short(tag)}'; {suggestion(tag, known)}"


def _pattern(value: Any, facts: Mapping[str, Any]) -> str:
    if facts["pattern"].startswith("^[A-Za-z_]"):
        return f"'{short(value)}' is no name; use letters, digits, _ and -, and no digit or - first"
    return f"must match {facts['pattern']}, is {shown(value)}"


_TYPES = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "string_type": "text",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
}
_WORDS: dict[str, Callable[[Any, Mapping[str, Any]], str]] = {
    "greater_than": _bound("above", "gt"),
    "greater_than_equal": _bound("at least", "ge"),
    "less_than": _bound("below", "lt"),
    "less_than_equal": _bound("at most", "le"),
    "too_long": lambda value, facts: _length(facts["max_length"], value),
    "too_short": lambda value, facts: f"must have at least {facts['min_length']} part, has {len(value)}",
    "color": _color,
    "ambient": _ambient,
    "literal_error": _choice,
    "union_tag_invalid": _tag,
    "union_tag_not_found": lambda value, facts: f"missing key {facts['discriminator']}",
    "string_pattern_mismatch": _pattern,
}
