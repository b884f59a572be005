"""The JSON schema of scene files, for editors: every key, its meaning, its range."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from illumcli.commands.schema_generator import DIALECT, schema_of
from illumcli.scene.curves import AnyCurve
from illumcli.scene.spec import Scene
from illumcli.schema.description import Description

EXTENDS = {
    "description": "Scenes that this one extends, by path from its own folder: mappings merge, anything else "
    "replaces, null removes a key.",
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
}

FIXED = ("version", "frames")
"""Keys of a scene that do not vary with the frame."""
CURVE = "A value that varies with the frame."

NULL = {"type": "null"}
REFERENCE = "#/$defs/"


def schema_text() -> str:
    """The schema as JSON text; ``schemas/scene.schema.json`` is this text."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> dict[str, Any]:
    """The schema of scenes, with all members of the open families.

    A scene that extends another may leave out required keys, and remove keys of the other by null.
    """
    scene_schema = schema_of(Scene)
    parts = scene_schema.pop("$defs")
    frames = parts.pop("Frames")
    parts = _curves() | {name: _varying(part) for name, part in parts.items()} | {"Frames": frames}
    fixed = {key: scene_schema["properties"][key] for key in FIXED}
    scene_schema = _varying(scene_schema)
    scene_schema["properties"] = {"extends": EXTENDS, **scene_schema["properties"], **fixed}
    partial = _Partial(parts)
    return {
        "$schema": DIALECT,
        "title": "illum scene",
        "description": scene_schema["description"],
        "type": "object",
        "if": {"required": ["extends"]},
        "then": partial.of(scene_schema),
        "else": scene_schema,
        "$defs": parts | partial.definitions,
    }


class _AnyCurve(Description):
    curve: AnyCurve


def _curves() -> dict[str, Any]:
    """Definitions of the curves, and `Curve`, which is any of them."""
    curves = schema_of(_AnyCurve)
    return {**curves["$defs"], "Curve": {"description": CURVE, **curves["properties"]["curve"]}}


def _varying(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema in which every value may be a curve; the tags of mappings may not."""

    def value(part: dict[str, Any]) -> dict[str, Any]:
        if "const" in part:
            return part
        part = _varying(part)
        about: dict[str, Any] = {key: part.pop(key) for key in ("description", "default") if key in part}
        plain = part.pop("anyOf") if list(part) == ["anyOf"] else [part]
        return {**about, "anyOf": [*plain, {"$ref": f"{REFERENCE}Curve"}]}

    varying = dict(schema)
    for key in ("properties", "patternProperties"):
        if key in varying:
            varying[key] = {name: value(part) for name, part in varying[key].items()}
    for key in ("anyOf", "oneOf"):
        if key in varying:
            varying[key] = [_varying(part) for part in varying[key]]
    if "items" in varying:
        varying["items"] = value(varying["items"])
    return varying


class _Partial:
    """Schemas of mappings that are merged into others: no key is required, and null removes one.

    Lists replace others as a whole, so their parts keep their schema.
    """

    def __init__(self, parts: Mapping[str, Any]) -> None:
        self._parts = parts
        self.definitions: dict[str, Any] = {}
        """The partial schemas that others refer to, by name."""

    def of(self, schema: Mapping[str, Any]) -> dict[str, Any]:
        """The schema of mappings that are merged into one of `schema`."""
        merged = {key: value for key, value in schema.items() if key not in ("required", "discriminator")}
        if "$ref" in merged:
            merged["$ref"] = self._reference(merged["$ref"])
        for key in ("properties", "patternProperties"):
            if key in merged:
                merged[key] = {name: self._or_null(self.of(part)) for name, part in merged[key].items()}
        if alternatives := [each for key in ("oneOf", "anyOf") for each in merged.pop(key, ())]:
            merged["anyOf"] = [self.of(each) for each in alternatives]  # without a tag it may be any of them
        return merged

    def _or_null(self, schema: dict[str, Any]) -> dict[str, Any]:
        about: dict[str, Any] = {key: schema.pop(key) for key in ("description", "default") if key in schema}
        return {**about, "anyOf": [schema, NULL]}

    def _reference(self, reference: str) -> str:
        name = reference.removeprefix(REFERENCE)
        if f"{name}.part" not in self.definitions:
            self.definitions[f"{name}.part"] = {}  # set first: it may refer to itself
            self.definitions[f"{name}.part"] = self.of(self._parts[name])
        return f"{reference}.part"
