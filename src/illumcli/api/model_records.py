"""What there is to know of the illumination models, as records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, overload

from illumcli.api.html_tables import html_table
from illumcli.commands.models import allowed, data
from illumcli.errors import InputError
from illumcli.records import Value
from illumcli.schema.docs import unit_in


class Parameter(Value):
    """What a parameter of a model may be."""

    name: str
    """Its key in a material."""
    kind: str
    """`number`, `colour`, `choice`, `switch`, `text`, `list` or `mapping`."""
    default: Any
    """None if it may be left out, or must be given."""
    required: bool
    """True if it must be given."""
    minimum: float | None
    """Of a number, or of each number of a colour."""
    maximum: float | None
    """The same, upwards."""
    choices: tuple[str, ...]
    """Of a choice, or the tags of a mapping."""
    unit: str
    """Such as `rad`; empty if it has none."""
    text: str
    """What it is."""
    takes: str
    """The values it takes, in words."""
    may_vary: bool
    """True if it may be a texture or values at vertices."""


class Model(Value):
    """What there is to know of an illumination model."""

    name: str
    """Its tag, the value of `model` in a material."""
    title: str
    """Such as `Oren-Nayar`."""
    text: str
    """What it is, in a sentence."""
    formula: str
    """Its description with the formula, as ``illum models NAME`` prints it."""
    sources: tuple[str, ...]
    """Where it is published."""
    claims: Mapping[str, bool]
    """`physical`, `reciprocal`, `conserving`, `isotropic`, with each choice at its default."""
    parameters: Mapping[str, Parameter]
    """By name, in the order of its class."""

    def _repr_html_(self) -> str:
        shown = ("name", "takes", "default", "unit", "text")
        rows = [{name: getattr(each, name) for name in shown} for each in self.parameters.values()]
        return f"<pre>{self.formula}</pre>\n{html_table(rows)}"


class Models(tuple[Model, ...]):
    """Records of models; a notebook shows a table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return html_table(
            [
                {
                    "name": each.name,
                    "what it is": each.text,
                    "parameters": ", ".join(each.parameters),
                    "claims": ", ".join(claim for claim, holds in each.claims.items() if holds),
                }
                for each in self
            ]
        )


@overload
def models(name: str) -> Model: ...
@overload
def models(name: None = None) -> Models: ...
def models(name: str | None = None) -> Model | Models:
    """The illumination models, or one of them, as records.

    Parameters
    ----------
    name : str, optional
        Of one model, such as `ward`.

    Returns
    -------
    Model or Models
        One, or a tuple of all.

    Raises
    ------
    IllumError
        No such model.

    Examples
    --------
    >>> illum.models("ward").parameters["alpha_x"].maximum
    10.0
    >>> [each.name for each in illum.models() if each.claims["physical"]]
    """
    if not isinstance(name, str | None):
        raise InputError(f"model: must be a name, is of type {type(name).__name__}")
    records = Models(map(_model, data(name)))
    return records if name is None else records[0]


def _model(entry: Mapping[str, Any]) -> Model:
    """The record of what ``illum models --json`` prints of a model."""
    formula, _, references = entry["description"].partition("\n\nReferences\n----------\n")
    title, _, text = " ".join(formula.partition("\n\n")[0].split()).partition(": ")
    schema = entry["schema"]
    parameters = {
        name: _parameter(name, field, name in schema.get("required", ()))
        for name, field in schema["properties"].items()
        if "const" not in field
    }
    sources = tuple(references.splitlines())
    return Model(entry["model"], title, text, formula, sources, entry["claims"], parameters)


def _parameter(name: str, field: Mapping[str, Any], required: bool) -> Parameter:
    """The record of a field of a schema."""
    text, plain = field.get("description", ""), _constant(field)
    number = plain.get("items", plain)
    return Parameter(
        name,
        _kind(plain),
        field.get("default"),
        required,
        number.get("minimum", number.get("exclusiveMinimum")),
        number.get("maximum"),
        tuple(number.get("enum", plain.get("discriminator", {}).get("mapping", ()))),
        unit_in(text),
        text,
        allowed(field),
        plain is not field and "vertex attribute" in allowed(field),
    )


def _constant(field: Mapping[str, Any]) -> Mapping[str, Any]:
    """The schema of a constant value in full, without that of textures and short forms."""
    if "anyOf" in field:
        return _constant(next(part for part in reversed(field["anyOf"]) if part.get("type") != "null"))
    return _constant(field["oneOf"][0]) if "oneOf" in field and "discriminator" not in field else field


def _kind(field: Mapping[str, Any]) -> str:
    """The kind of a constant value."""
    if "discriminator" in field or "patternProperties" in field:
        return "mapping"
    if "enum" in field:
        return "choice"
    if field["type"] == "array":
        return "colour" if field["items"].get("type") == "number" else "list"
    return {"boolean": "switch", "string": "text"}.get(field["type"], field["type"])
