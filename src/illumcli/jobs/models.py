"""Pages about illumination models, from their own docstrings and schemas."""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel
from illumcli.variants import member, members

PACKAGE = "illumcli.models"
CLAIMS = {
    "physical": "a BRDF times the cosine",
    "reciprocal": "light and eye may change places",
    "conserving": "no more light leaves than arrives",
    "isotropic": "turning the surface about its normal changes nothing",
}
SHARED = ("emission", "ambient")  # what every model has


def table() -> str:
    """Tag, parameters and claims of every model, one line each."""
    rows = [("model", "parameters", "claims")]
    for Model in members(PACKAGE):
        names = [name for name in Model.model_fields if name not in ("model", *SHARED)]
        claims = [claim for claim in CLAIMS if getattr(Model, claim)]
        rows.append((_tag(Model), ", ".join(names), ", ".join(claims)))
    first, second = (max(len(row[i]) for row in rows) for i in (0, 1))
    return "\n".join(f"{a:{first}}  {b:{second}}  {c}".rstrip() for a, b, c in rows)


def page(tag: str) -> str:
    """Everything about one model: formula, sources, parameters with default, range and meaning, claims.

    Raises
    ------
    InputError
        No such model.
    """
    try:
        Model = member(PACKAGE, tag)
    except LookupError as error:
        raise InputError(f"no model '{tag}'; {error}") from None
    lines = [inspect.cleandoc(sys.modules[Model.__module__].__doc__ or ""), "", "Parameters", "----------"]
    schema = Model.model_json_schema()
    lines += _parameters(Model, schema, schema.get("$defs", {}))
    lines += ["", "Claims", "------"]
    lines += [
        f"{'yes' if getattr(Model, claim) else 'no':4}{claim}: {text}" for claim, text in CLAIMS.items()
    ]
    return "\n".join(lines)


def meanings(cls: type[Any]) -> dict[str, str]:
    """Field -> the docstring under it, of the class and the classes it stands on.

    Read from the source when asked: pydantic would parse every source at import.
    """
    found: dict[str, str] = {}
    for each in reversed(cls.__mro__):
        if not each.__module__.startswith("illumcli."):
            continue
        body = next(
            node.body
            for node in ast.parse(inspect.getsource(sys.modules[each.__module__])).body
            if isinstance(node, ast.ClassDef) and node.name == each.__name__
        )
        for field, text in pairwise(body):
            if (
                isinstance(field, ast.AnnAssign)
                and isinstance(field.target, ast.Name)
                and isinstance(text, ast.Expr)
                and isinstance(text.value, ast.Constant)
            ):
                found[field.target.id] = inspect.cleandoc(str(text.value.value)).replace("\n", " ")
    return found


def _tag(Model: type[IlluminationModel]) -> str:
    return str(Model.model_fields["model"].default)


def _parameters(cls: type[Any], schema: Mapping[str, Any], defs: Mapping[str, Any]) -> Iterator[str]:
    text = meanings(cls)
    fields = [name for name in cls.model_fields if name not in SHARED]
    for name in [*fields, *(each for each in SHARED if each in cls.model_fields)]:
        field = schema["properties"][name]
        if "const" in field:
            continue
        yield f"{name}: {allowed(field)}; {_default(field)}"
        if name in text:
            yield textwrap.fill(text[name], 100, initial_indent="    ", subsequent_indent="    ")
        if "discriminator" in field:
            for tag, part in _parts(cls, name).items():
                key = field["discriminator"]["propertyName"]
                doc = inspect.cleandoc(part.__doc__ or "").replace("\n", " ")
                yield f"    {{{key}: {tag}}}: {doc}"
                inner = "\n".join(_parameters(part, defs[part.__name__], defs))
                yield textwrap.indent(inner, "        ")


def _parts(cls: type[Any], name: str) -> dict[str, type[Any]]:
    """Tag -> class of each choice of a field that is told apart by a key."""
    info = cls.model_fields[name]
    key = str(info.discriminator)
    return {part.model_fields[key].default: part for part in info.annotation.__args__}


def allowed(field: Mapping[str, Any]) -> str:
    """The values a field takes, in words, from its schema."""
    if "anyOf" in field:
        return allowed(field["anyOf"][0])
    if "discriminator" in field:
        key = field["discriminator"]["propertyName"]
        return f"one of {{{key}: {' | '.join(field['discriminator']['mapping'])}}}"
    if "oneOf" in field:
        return f"{allowed(field['oneOf'][0])}, a texture or a vertex attribute"
    if "enum" in field:
        return " | ".join(map(str, field["enum"]))
    if field["type"] == "array":
        return f"colour, {_range(field['prefixItems'][0])}"
    if field["type"] == "number":
        return f"number, {_range(field)}"
    return {"boolean": "true | false", "string": "text"}[field["type"]]


def _range(number: Mapping[str, Any]) -> str:
    above = number.get("exclusiveMinimum")
    low = f"above {above:g}" if above is not None else f"{number['minimum']:g}"
    return f"{low} to {number['maximum']:g}"


def _default(field: Mapping[str, Any]) -> str:
    if "default" not in field:
        return "required"
    default = field["default"]
    if default is None:
        return "by default left out"
    if isinstance(default, list) and len(set(default)) == 1:
        default = default[0]
    if isinstance(default, bool):
        default = str(default).lower()
    if isinstance(default, dict):
        default = "{" + ", ".join(f"{name}: {value}" for name, value in default.items()) + "}"
    return f"by default {default}"
