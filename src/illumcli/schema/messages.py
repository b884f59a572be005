"""Messages about invalid values, from the type and the context of pydantic's errors.

Our own rules raise ValueError with a message; the table below has one for each rule of pydantic.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

SENTENCES = {
    "greater_than": "must be above {gt:g}, is {value}",
    "greater_than_equal": "must be at least {ge:g}, is {value}",
    "less_than": "must be below {lt:g}, is {value}",
    "less_than_equal": "must be at most {le:g}, is {value}",
    "float_type": "must be a number, is {value}",
    "finite_number": "must be a finite number, is {value}",
    "int_type": "must be a whole number, is {value}",
    "int_from_float": "must be a whole number, is {value}",
    "bool_type": "must be true or false, is {value}",
    "string_type": "must be text, is {value}",
    "string_pattern_mismatch": "must match {pattern}, is {value}",
    "string_too_long": "must have at most {max_length} characters",
    "tuple_type": "must be a list, is {value}",
    "dict_type": "must be a mapping, is {value}",
    "model_type": "must be a mapping, is {value}",
    "model_attributes_type": "must be a mapping, is {value}",
}
"""Type of an error -> message; in braces, values of the error's context and the invalid value."""


def sentence(kind: str, context: Mapping[str, Any], value: Any) -> str | None:
    """The message for an error of this type and context; None if it needs more than these."""
    if isinstance(context.get("error"), ValueError):
        return str(context["error"])
    if kind in SENTENCES:
        return SENTENCES[kind].format(**context, value=describe(value))
    return None


def no_choice(value: Any, choices: Sequence[Any]) -> str:
    """The message for a value that is none of the choices."""
    if isinstance(value, str) and all(isinstance(each, str) for each in choices):
        return f"no choice '{short(value)}'; {suggestion(value, choices)}"
    *others, last = map(repr, choices)
    listed = f"{', '.join(others)} or {last}" if others else last
    return f"must be {listed}, is {describe(value)}"


def wrong_length(value: Sequence[Any], length: int) -> str:
    """The message for a list that has too few or too many parts."""
    numbers = " numbers" if value and all(isinstance(part, int | float) for part in value) else ""
    return f"must be a list of {length}{numbers}, has {len(value)}"


def describe(value: Any) -> str:
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


def short(text: str, most: int = 40) -> str:
    """`text` on one line, truncated to `most` characters."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def suggestion(word: str, known: Sequence[str]) -> str:
    """Advice about a misspelt word: the most similar known word, or all of them if none is similar."""
    near = nearest(word, known)
    return f"did you mean '{near}'?" if near else f"there are: {', '.join(known)}"


def nearest(word: str, known: Sequence[str]) -> str | None:
    """The known word most similar to a misspelt one; None if none is similar."""
    import difflib

    return next(iter(difflib.get_close_matches(word, known, n=1, cutoff=0.6)), None)
