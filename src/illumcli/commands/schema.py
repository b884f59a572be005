"""The JSON schema of scene files, for editors: every key, its meaning, its range."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from illumcli.commands.schema_generator import DIALECT, schema_of
from illumcli.scene.spec import Scene

EXTENDS = {
    "description": "Scenes that this one extends, by path from its own folder: mappings merge, anything else "
    "replaces, null removes a key.",
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
}

NULL = {"type": "null"}
REFERENCE = "#/$defs/"


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
        "$schema": DIALECT,
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
