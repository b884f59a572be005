"""JSON schemas of descriptions: pydantic's, with the texts of classes, fields and rows of tables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from illumcli.layers import LAYERS
from illumcli.schema.annotations import field_annotation
from illumcli.schema.description import Description
from illumcli.schema.docs import choices, field_docs, summary
from illumcli.shading.rates import RATES
from illumcli.visibility.samplers import SAMPLERS

DIALECT = GenerateJsonSchema.schema_dialect
MAY_BE_LEFT_OUT = ("projection",)  # of the keys that tag a mapping


def schema_of(cls: type[Description]) -> dict[str, Any]:
    """The schema of one description; its parts are under `$defs`."""
    return cls.model_json_schema(schema_generator=_Schema)


@cache
def schema_of_field(cls: type[Description], name: str) -> Mapping[str, Any]:
    """The schema of one field, with its text and default, without the schemas of its class and the others.

    There is no default if the field is required, or holds a description with all its defaults.
    """
    field = cls.model_fields[name]
    adapter: TypeAdapter[Any] = TypeAdapter(field_annotation(cls, name))
    part = adapter.json_schema(schema_generator=_Schema)
    if text := field_docs(cls).get(name):
        _describe(part, text)
    if not field.is_required() and field.default != {}:
        part["default"] = list(field.default) if isinstance(field.default, tuple) else field.default
    return part


TABLES: tuple[Mapping[str, str], ...] = (
    {row.name: row.text for row in LAYERS},
    {name: rate.text for name, rate in RATES.items()},
    {name: sampler.text for name, sampler in SAMPLERS.items()},
)
"""Name -> text of the rows of tables whose names are choices."""


def _with_rows(part: dict[str, Any], text: str) -> str:
    """A field's text; if its choices are the rows of a table, with the text of each."""
    for inner in _inner(part):
        for table in TABLES:
            if inner.get("enum") == list(table):
                text = " ".join([text, *(f"`{name}`: {meaning}" for name, meaning in table.items())])
    return text


def _inner(part: dict[str, Any]) -> list[dict[str, Any]]:
    """The parts of a field's schema that may hold its choices."""
    return [part, part.get("items", {}), *part.get("anyOf", ())]


def _describe(part: dict[str, Any], text: str) -> None:
    """Put a field's text into its schema, and the sentence about each choice beside the choices, where
    editors show it."""
    part["description"] = text = _with_rows(part, text)
    for inner in _inner(part):
        if "enum" in inner and (sentences := choices(text, inner["enum"])):
            inner["enumDescriptions"] = sentences


class _Schema(GenerateJsonSchema):
    """pydantic's schema with our texts, without titles that only repeat a key."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def model_schema(self, schema: Any) -> JsonSchemaValue:
        """A description with the texts of its class and fields."""
        cls = schema["cls"]
        docs = field_docs(cls)
        generated = super().model_schema(schema)
        properties, required = generated["properties"], set(generated.get("required", ()))
        for name, part in properties.items():
            if text := docs.get(name) or ("const" in part and summary(cls)):
                _describe(part, text)
            if part.get("default") == {}:  # a description with all its defaults
                del part["default"]
            if isinstance(part.get("const"), str) and name not in MAY_BE_LEFT_OUT:
                part.pop("default", None)
                required.add(name)
        description: JsonSchemaValue = {
            "type": "object",
            "title": cls.__name__,
            "description": summary(cls),
            "properties": properties,
            "additionalProperties": False,
        }
        if required:
            description["required"] = [name for name in properties if name in required]
        return description

    def tuple_schema(self, schema: Any) -> JsonSchemaValue:
        """A list whose parts have equal schemas has that schema once."""
        listed = super().tuple_schema(schema)
        parts = listed.get("prefixItems", [])
        if parts and all(part == parts[0] for part in parts):
            del listed["prefixItems"]
            listed["items"] = parts[0]
        return listed

    def dict_schema(self, schema: Any) -> JsonSchemaValue:
        """Keys that are not names are refused."""
        keyed = super().dict_schema(schema)
        return {**keyed, "additionalProperties": False} if "patternProperties" in keyed else keyed
