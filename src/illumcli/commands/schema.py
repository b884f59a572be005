"""The JSON schema of scene files, for editors: every key, its meaning, its range."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from illumcli.layers import LAYERS
from illumcli.scene.spec import Scene
from illumcli.schema.description import Description
from illumcli.schema.docs import choices, field_docs, summary
from illumcli.shading.rates import RATES
from illumcli.visibility.samplers import SAMPLERS

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
    scene_schema = schema_of(Scene)
    scene_schema["properties"] = {"extends": EXTENDS, **scene_schema["properties"]}
    parts = scene_schema.pop("$defs")
    partial = _Partial(parts)
    return {
        "$schema": GenerateJsonSchema.schema_dialect,
        "title": "illum scene",
        "description": scene_schema["description"],
        "type": "object",
        "if": {"required": ["extends"]},
        "then": partial.of(scene_schema),
        "else": scene_schema,
        "$defs": parts | partial.made,
    }


class _Partial:
    """Schemas of mappings that complete others: no key is required, and null removes one.

    Parts of lists replace others, so they keep their schema.
    """

    def __init__(self, parts: Mapping[str, Any]) -> None:
        self._parts = parts
        self.made: dict[str, Any] = {}
        """Schemas by name, of the parts that were needed."""

    def of(self, schema: Mapping[str, Any]) -> dict[str, Any]:
        """The schema of mappings that complete one which `schema` describes."""
        made = {key: value for key, value in schema.items() if key not in ("required", "discriminator")}
        if "$ref" in made:
            made["$ref"] = self._reference(made["$ref"])
        for key in ("properties", "patternProperties"):
            if key in made:
                made[key] = {name: self._or_null(self.of(part)) for name, part in made[key].items()}
        if alternatives := [each for key in ("oneOf", "anyOf") for each in made.pop(key, ())]:
            made["anyOf"] = [self.of(each) for each in alternatives]  # without its tag it may be any
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


TABLES: tuple[Mapping[str, str], ...] = (
    {row.name: row.text for row in LAYERS},
    {name: rate.text for name, rate in RATES.items()},
    {name: sampler.text for name, sampler in SAMPLERS.items()},
)
"""What the rows of tables mean whose names are choices."""


def _with_rows(part: dict[str, Any], text: str) -> str:
    """A field's text, with what each choice means where the choices are the rows of a table."""
    for inner in _inner(part):
        for table in TABLES:
            if inner.get("enum") == list(table):
                text = " ".join([text, *(f"`{name}`: {meaning}" for name, meaning in table.items())])
    return text


def _inner(part: dict[str, Any]) -> list[dict[str, Any]]:
    """The parts of a field's schema in which its choices may stand."""
    return [part, part.get("items", {}), *part.get("anyOf", ())]


def _describe_choices(part: dict[str, Any], text: str) -> None:
    """Put what a field's text says of each choice beside the choices, as editors show it."""
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
                part["description"] = text = _with_rows(part, text)
                _describe_choices(part, text)
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
        """A list of equal parts says so once."""
        listed = super().tuple_schema(schema)
        parts = listed.get("prefixItems", [])
        if parts and all(part == parts[0] for part in parts):
            del listed["prefixItems"]
            listed["items"] = parts[0]
        return listed

    def dict_schema(self, schema: Any) -> JsonSchemaValue:
        """Keys that are no names are refused."""
        keyed = super().dict_schema(schema)
        return {**keyed, "additionalProperties": False} if "patternProperties" in keyed else keyed
