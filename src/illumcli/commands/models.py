"""Pages about illumination models, from their own docstrings and schemas."""

from __future__ import annotations

import inspect
import sys
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from illumcli.commands.schema_generator import schema_of
from illumcli.errors import InputError
from illumcli.models._base import CLAIMS
from illumcli.schema.families import member, members, tag_of

PACKAGE = "illumcli.models"
SHARED = ("emission", "ambient")  # what every model has


def table() -> str:
    """Tag, parameters and claims of every model, one line each."""
    rows = [("model", "parameters", "claims")]
    for Model in members(PACKAGE):
        names = [name for name in Model.model_fields if name not in ("model", *SHARED)]
        claims = [claim for claim in CLAIMS if getattr(Model, claim)]
        rows.append((tag_of(Model), ", ".join(names), ", ".join(claims)))
    first, second = (max(len(row[i]) for row in rows) for i in (0, 1))
    return "\n".join(f"{a:{first}}  {b:{second}}  {c}".rstrip() for a, b, c in rows)


def page(tag: str) -> str:
    """Everything about one model: formula, sources, parameters with default, range and meaning, claims.

    Raises
    ------
    InputError
        No such model.
    """
    Model = _model(tag)
    lines = [inspect.cleandoc(sys.modules[Model.__module__].__doc__ or ""), "", "Parameters", "----------"]
    schema = schema_of(Model)
    lines += _parameters(schema, schema.get("$defs", {}))
    title = "Claims, with each choice and optional parameter at its default"
    lines += ["", title, "-" * len(title)]
    lines += [
        f"{'yes' if getattr(Model, claim) else 'no':4}{claim}: {text}" for claim, text in CLAIMS.items()
    ]
    return "\n".join(lines)


def data(tag: str | None = None) -> list[dict[str, Any]]:
    """All models, or one, for JSON: tag, description, claims, and the schema of the parameters.

    Raises
    ------
    InputError
        No such model.
    """
    return [
        {
            "model": tag_of(Model),
            "description": inspect.cleandoc(sys.modules[Model.__module__].__doc__ or ""),
            "claims": {claim: bool(getattr(Model, claim)) for claim in CLAIMS},
            "schema": schema_of(Model),
        }
        for Model in ([_model(tag)] if tag is not None else members(PACKAGE))
    ]


def _model(tag: str) -> Any:
    """The class of a model."""
    try:
        return member(PACKAGE, tag)
    except LookupError as error:
        raise InputError(f"no model '{tag}'; {error}") from None


def _parameters(schema: Mapping[str, Any], defs: Mapping[str, Any]) -> Iterator[str]:
    properties = schema["properties"]
    parameters = [name for name in properties if name not in SHARED]
    for name in [*parameters, *(each for each in SHARED if each in properties)]:
        field = properties[name]
        if "const" in field:
            continue
        yield f"{name}: {allowed(field)}; {_default(field)}"
        if "description" in field:
            yield textwrap.fill(field["description"], 100, initial_indent="    ", subsequent_indent="    ")
        if "$ref" in field.get("items", {}):
            yield textwrap.indent("\n".join(_parameters(_part(field["items"], defs), defs)), "        ")
        if "discriminator" in field:
            key, choices = field["discriminator"]["propertyName"], field["discriminator"]["mapping"]
            for tag, reference in choices.items():
                part = _part({"$ref": reference}, defs)
                yield f"    {{{key}: {tag}}}: {part['description']}"
                yield textwrap.indent("\n".join(_parameters(part, defs)), "        ")


def _part(reference: Mapping[str, Any], defs: Mapping[str, Any]) -> Any:
    """The schema that a reference names."""
    return defs[reference["$ref"].rpartition("/")[2]]


def allowed(field: Mapping[str, Any]) -> str:
    """The values a field takes, in words, from its schema."""
    if "anyOf" in field:  # something that may be left out, or a number for a colour
        return allowed(next(part for part in reversed(field["anyOf"]) if part.get("type") != "null"))
    if "discriminator" in field:
        key = field["discriminator"]["propertyName"]
        return f"one of {{{key}: {' | '.join(field['discriminator']['mapping'])}}}"
    if "oneOf" in field:
        return f"{allowed(field['oneOf'][0])}, a texture or a vertex attribute"
    if "enum" in field:
        return " | ".join(map(str, field["enum"]))
    if field["type"] == "array" and "$ref" in field["items"]:
        return "a list of mappings"
    if "patternProperties" in field:
        (value,) = field["patternProperties"].values()
        return f"names with values: {allowed(value)}"
    if field["type"] == "array" and "enum" in field["items"]:
        return f"list of {allowed(field['items'])}"
    if field["type"] == "array":
        return f"colour, {_range(field['items'])}"
    if field["type"] == "number":
        return f"number, {_range(field)}"
    return {"boolean": "true | false", "string": "text"}[field["type"]]


def _range(number: Mapping[str, Any]) -> str:
    above = number.get("exclusiveMinimum")
    low = f"above {above:g}" if above is not None else f"{number['minimum']:g}"
    return f"{low} to {number['maximum']:g}"


def _default(field: Mapping[str, Any]) -> str:
    if "patternProperties" in field:
        return "by default none"
    if "default" not in field:
        return "required"
    default = field["default"]
    if default is None:
        return "by default left out"
    if default == []:
        return "by default none"
    if isinstance(default, list) and len(set(default)) == 1:
        default = default[0]
    if isinstance(default, bool):
        default = str(default).lower()
    if isinstance(default, dict):
        default = "{" + ", ".join(f"{name}: {value}" for name, value in default.items()) + "}"
    return f"by default {default}"
