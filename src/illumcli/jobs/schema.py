"""The JSON schema of scene files, for editors: every key, its meaning, its range."""

from __future__ import annotations

import json
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from illumcli.description import spread
from illumcli.docstrings import field_docs, summary
from illumcli.scene.spec import Scene

EXTENDS = {
    "description": "Scenes that this one extends, by path from its own folder: mappings merge, anything else "
    "replaces, null removes a key.",
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
}

MAY_BE_LEFT_OUT = ("projection",)  # of the keys that say what a mapping is


def run() -> str:
    """The schema as JSON text; ``schemas/scene.schema.json`` is this text."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> dict[str, Any]:
    """The schema, all members of the open families included."""
    made = Scene.model_json_schema(schema_generator=_Schema)
    made["properties"] = {"extends": EXTENDS, **made["properties"]}
    return {"$schema": GenerateJsonSchema.schema_dialect, **made, "title": "illum scene"}


class _Schema(GenerateJsonSchema):
    """pydantic's schema with our texts, without titles that only repeat a key."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        made, cls = super().model_schema(schema), schema["cls"]
        made["description"] = summary(cls)
        docs = field_docs(cls)
        for name, part in made["properties"].items():
            if name in docs:
                part["description"] = docs[name]
            if isinstance(part.get("const"), str) and name not in MAY_BE_LEFT_OUT:
                part.pop("default", None)
                made["required"] = sorted({name, *made.get("required", ())})
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

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
        """One number may stand for three."""
        made = super().function_before_schema(schema)
        if schema["function"]["function"] is spread:
            return {"anyOf": [made["items"], made]}
        return made
