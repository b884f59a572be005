"""The JSON schema of scene files, for editors: every key, its meaning, its range."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from illumcli.scene.spec import Scene
from illumcli.schema.description import Description
from illumcli.schema.docs import choices, field_docs, summary
from illumcli.schema.families import members
from illumcli.schema.fields import HEX, color, spread

EXTENDS = {
    "description": "Scenes that this one extends, by path from its own folder: mappings merge, anything else "
    "replaces, null removes a key.",
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
}

SRGB = {
    "type": "string",
    "pattern": HEX,
    "description": "A colour in sRGB, made linear: '#rrggbb', or '#rgb' for equal digits.",
}
NULL = {"type": "null"}
REFERENCE = "#/$defs/"
MAY_BE_LEFT_OUT = ("projection",)  # of the keys that say what a mapping is


def run() -> str:
    """The schema as JSON text; ``schemas/scene.schema.json`` is this text."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> dict[str, Any]:
    """The schema of scenes, all members of the open families included.

    A scene that extends another need not say what the other says, and may take parts of it away.
    """
    whole = schema_of(Scene)
    whole["properties"] = {"extends": EXTENDS, **whole["properties"]}
    parts = whole.pop("$defs")
    partial = _Partial(parts)
    return {
        "$schema": GenerateJsonSchema.schema_dialect,
        "title": "illum scene",
        "description": whole["description"],
        "type": "object",
        "if": {"required": ["extends"]},
        "then": partial.of(whole),
        "else": whole,
        "$defs": parts | partial.made,
    }


class _Partial:
    """Schemas of mappings that complete others: no key is required, and null removes one.

    What stands in lists replaces, so it is whole.
    """

    def __init__(self, parts: Mapping[str, Any]) -> None:
        self._parts = parts
        self.made: dict[str, Any] = {}
        """By name: the parts that were asked for."""

    def of(self, schema: Mapping[str, Any]) -> dict[str, Any]:
        """The schema of what may complete that which `schema` describes."""
        made = {key: value for key, value in schema.items() if key not in ("required", "discriminator")}
        if "$ref" in made:
            made["$ref"] = self._reference(made["$ref"])
        for key in ("properties", "patternProperties"):
            if key in made:
                made[key] = {name: self._or_null(self.of(part)) for name, part in made[key].items()}
        if found := [each for key in ("oneOf", "anyOf") for each in made.pop(key, ())]:
            made["anyOf"] = [self.of(each) for each in found]  # what says not what it is may be any of them
        return made

    def _or_null(self, schema: dict[str, Any]) -> dict[str, Any]:
        about: dict[str, Any] = {key: schema.pop(key) for key in ("description", "default") if key in schema}
        return {**about, "anyOf": [schema, NULL]}

    def _reference(self, reference: str) -> str:
        name = reference.removeprefix(REFERENCE)
        if f"{name}.part" not in self.made:
            self.made[f"{name}.part"] = {}  # it may refer to itself
            self.made[f"{name}.part"] = self.of(self._parts[name])
        return f"{reference}.part"


def schema_of(cls: type[Description]) -> dict[str, Any]:
    """The schema of one description; those it is made of are under `$defs`."""
    return _Schema().generate(_named(cls.core_schema()))


def _named(part: Any) -> Any:
    """A schema of pydantic's core in which every description has a name to be referred to by."""
    if isinstance(part, list):
        return [_named(each) for each in part]
    if not isinstance(part, dict):
        return part
    made = {key: value if key == "metadata" else _named(value) for key, value in part.items()}
    return {**made, "ref": made["cls"].__name__} if "cls" in made else made


def _describe_choices(part: dict[str, Any], text: str) -> None:
    """Put what a field's text says of each choice beside the choices, as editors show it."""
    for inner in [part, part.get("items", {}), *part.get("anyOf", ())]:
        if "enum" in inner and (said := choices(text, inner["enum"])):
            inner["enumDescriptions"] = said


class _Schema(GenerateJsonSchema):
    """pydantic's schema with our texts, without titles that only repeat a key."""

    def typed_dict_schema(self, schema: core_schema.TypedDictSchema) -> JsonSchemaValue:
        cls = schema["cls"]
        docs = field_docs(cls)
        properties, required = {}, []
        for name, field in schema["fields"].items():
            part = properties[name] = self.generate_inner(field)
            if text := docs.get(name) or ("const" in part and summary(cls)):
                part["description"] = text
                _describe_choices(part, text)
            if part.get("default") == {}:  # what is described by all its defaults
                del part["default"]
            says_what = isinstance(part.get("const"), str) and name not in MAY_BE_LEFT_OUT
            if says_what:
                part.pop("default", None)
            if says_what or field["required"]:
                required.append(name)
        made: JsonSchemaValue = {
            "type": "object",
            "title": cls.__name__,
            "description": summary(cls),
            "properties": properties,
            "additionalProperties": False,
        }
        return {**made, "required": required} if required else made

    def function_plain_schema(self, schema: core_schema.PlainValidatorFunctionSchema) -> JsonSchemaValue:
        """Any member of an open family."""
        family = schema["metadata"]["family"]
        choices = [self.generate_inner(_named(each.core_schema())) for each in members(family.package)]
        return {"oneOf": choices, "discriminator": {"propertyName": family.tag}}

    def tuple_schema(self, schema: core_schema.TupleSchema) -> JsonSchemaValue:
        """A list of equal parts says so once."""
        made = super().tuple_schema(schema)
        parts = made.get("prefixItems", [])
        if parts and all(part == parts[0] for part in parts):
            del made["prefixItems"]
            made["items"] = parts[0]
        return made

    def dict_schema(self, schema: core_schema.DictSchema) -> JsonSchemaValue:
        """Keys that are no names are refused."""
        made = super().dict_schema(schema)
        return {**made, "additionalProperties": False} if "patternProperties" in made else made

    def function_before_schema(self, schema: core_schema.BeforeValidatorFunctionSchema) -> JsonSchemaValue:
        """One number may stand for three, or a text for a colour."""
        made = super().function_before_schema(schema)
        if schema["function"]["function"] is spread:
            return {"anyOf": [made["items"], made]}
        if schema["function"]["function"] is color:
            return {"anyOf": [made["items"], SRGB, made]}
        return made

    def function_after_schema(self, schema: core_schema.AfterValidatorFunctionSchema) -> JsonSchemaValue:
        """A text of a form."""
        made = super().function_after_schema(schema)
        form = schema.get("metadata", {}).get("form")
        return {**made, "pattern": form} if form else made
