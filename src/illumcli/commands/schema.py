"""The JSON schema of scene files, for editors: every key, its meaning, its range."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from illumcli.scene.spec import Scene
from illumcli.schema.description import Description
from illumcli.schema.docs import choices, field_docs, summary

EXTENDS = {
    "description": "Scenes that this one extends, by path from its own folder: mappings merge, anything else "
    "replaces, null removes a key.",
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
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
    return cls.model_json_schema(schema_generator=_Schema)


def _describe_choices(part: dict[str, Any], text: str) -> None:
    """Put what a field's text says of each choice beside the choices, as editors show it."""
    for inner in [part, part.get("items", {}), *part.get("anyOf", ())]:
        if "enum" in inner and (said := choices(text, inner["enum"])):
            inner["enumDescriptions"] = said


class _Schema(GenerateJsonSchema):
    """pydantic's schema with our texts, without titles that only repeat a key."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def model_schema(self, schema: Any) -> JsonSchemaValue:
        """A description with the texts of its class and fields."""
        cls = schema["cls"]
        docs = field_docs(cls)
        made = super().model_schema(schema)
        required = set(made.pop("required", ()))
        for name, part in made["properties"].items():
            if text := docs.get(name) or ("const" in part and summary(cls)):
                part["description"] = text
                _describe_choices(part, text)
            if part.get("default") == {}:  # what is described by all its defaults
                del part["default"]
            if isinstance(part.get("const"), str) and name not in MAY_BE_LEFT_OUT:
                part.pop("default", None)
                required.add(name)
        about = {"type": "object", "title": cls.__name__, "description": summary(cls)}
        made = {**about, "properties": made["properties"], "additionalProperties": False}
        return (
            {**made, "required": [name for name in made["properties"] if name in required]}
            if required
            else made
        )

    def tuple_schema(self, schema: Any) -> JsonSchemaValue:
        """A list of equal parts says so once."""
        made = super().tuple_schema(schema)
        parts = made.get("prefixItems", [])
        if parts and all(part == parts[0] for part in parts):
            del made["prefixItems"]
            made["items"] = parts[0]
        return made

    def dict_schema(self, schema: Any) -> JsonSchemaValue:
        """Keys that are no names are refused."""
        made = super().dict_schema(schema)
        return {**made, "additionalProperties": False} if "patternProperties" in made else made
