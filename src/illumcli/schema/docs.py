"""Docstrings of classes and of their fields, read from the sources when they are needed.

The docstring of a field is the string below it, which Python does not keep.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Sequence
from functools import cache

from illumcli.schema.description import Description


def field_docs(cls: type) -> dict[str, str]:
    """Field -> its docstring, with inherited fields; fields without a docstring are left out."""
    docs: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if not issubclass(base, Description):
            continue
        docs |= _docs_of_module(base.__module__).get(base.__qualname__, {})
    return docs


def summary(cls: type) -> str:
    """The first paragraph of a class's own docstring, or of its module's if it has none."""
    text = vars(cls).get("__doc__") or sys.modules[cls.__module__].__doc__ or ""
    return _one_line(inspect.cleandoc(text).partition("\n\n")[0])


def choices(text: str, names: Sequence[str]) -> list[str]:
    """The sentence of a field's text about each of its choices, as in "`name`: what it is."; empty if one is
    missing."""
    quoted = "|".join(map(re.escape, names))
    parts = re.split(rf"`({quoted})`: ", text)
    sentences = dict(zip(parts[1::2], parts[2::2], strict=True))
    return [sentences[name].strip() for name in names] if sentences.keys() >= set(names) else []


def unit_in(text: str) -> str:
    """The unit that a field's text names: `degrees` of "Vertical field of view [degrees]."."""
    unit = re.search(r"\[([^\]\d,][^\],]*)\]", text)
    return unit[1] if unit else ""


@cache
def _docs_of_module(module: str) -> dict[str, dict[str, str]]:
    """Class -> field -> docstring, of a module; empty if its source is not there."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except OSError:
        return {}
    return {each.name: _in_class(each) for each in tree.body if isinstance(each, ast.ClassDef)}


def _in_class(cls: ast.ClassDef) -> dict[str, str]:
    docs: dict[str, str] = {}
    for field, text in zip(cls.body, cls.body[1:], strict=False):
        if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
            continue
        if (
            isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
            and isinstance(text.value.value, str)
        ):
            docs[field.target.id] = _one_line(text.value.value)
    return docs


def _one_line(text: str) -> str:
    return " ".join(text.split())
