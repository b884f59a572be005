"""Examples of the keys of scenes: the shortest value that a scene of the repository gives them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from illumcli.commands.schema import schema
from sitepages.facts import REFERENCE, Fact, Part, Schema, alternatives, part_of, yaml_words

LONGEST = 90
"""Letters of an example."""


class Examples:
    """What scenes give to each key of each description."""

    def __init__(self, scenes: list[Path]) -> None:
        whole = schema()
        self._definitions = whole["$defs"]
        self._found: dict[tuple[str, str], list[str]] = defaultdict(list)
        top = {"title": "Scene", **whole["else"]}
        for scene in scenes:
            keys = yaml.safe_load(scene.read_text())
            if "extends" not in keys:  # of those that do, parts alone need not be valid
                self._visit(top, keys)

    def of(self, part: Part, fact: Fact) -> str:
        """An example of a key's value; empty if there is none."""
        texts = [text for text in self._found[part.name, fact.key] if len(text) <= LONGEST]
        return min(texts, key=lambda text: (f"`{text}`" in fact.default, len(text)), default="") or example(
            part, fact
        )

    def _visit(self, field: Schema, value: Any) -> None:
        """Record the values of the keys of a mapping, and of what is in it."""
        for each in self._resolved(field):
            if isinstance(value, list) and each.get("type") == "array":
                for inner in value:
                    self._visit(each["items"], inner)
            elif isinstance(value, dict) and "patternProperties" in each:
                for inner in value.values():
                    self._visit(next(iter(each["patternProperties"].values())), inner)
            elif isinstance(value, dict) and "properties" in each and fits(each, value):
                name = part_of(each).name
                for key, inner in value.items():
                    if key in each["properties"]:
                        self._found[name, key].append(yaml_words(inner))
                        self._visit(each["properties"][key], inner)
                return

    def _resolved(self, field: Schema) -> Iterator[Schema]:
        """What a field may be, with the descriptions that it refers to."""
        for each in alternatives(field):
            if "$ref" in each:
                yield from self._resolved(self._definitions[each["$ref"].removeprefix(REFERENCE)])
            else:
                yield each


def fits(description: Schema, value: dict[str, Any]) -> bool:
    """Is a mapping one of this description? Its tag must be the same, and all keys known."""
    fields = description.get("properties", {})
    constants = {key: field["const"] for key, field in fields.items() if "const" in field}
    return value.keys() <= fields.keys() | {"extends"} and all(
        value.get(key, constant if key == "projection" else None) == constant
        for key, constant in constants.items()
        if key != "version"
    )


WRITTEN = {
    "scene.cameras": "{front: {position: [0, 1, 5]}, side: {position: [5, 1, 0]}}",
    "scene.outputs": "{layers: [beauty, depth], files: ['{scene}.exr']}",
    "perspective.fit": "pot",
    "orthographic.fit": "pot",
    "film.adaptive": "true",
    "film.filter": "{filter: gaussian}",
    "mesh_file.file": "bunny.obj",
    "mesh_file.normals": "{crease: 30}",
    "mesh_file.obscurance": "bunny.npz",
    "object.fallback": "clay",
    "transform.matrix": "[[1, 0, 0, 0], [0, 1, 0, 2], [0, 0, 1, 0], [0, 0, 0, 1]]",
    "outputs.layers": "[beauty, depth, normal]",
    "outputs.files": "['out/{scene}.{camera}.{layer}.png']",
    "spot.name": "lamp",
    "texture.texture": "bark.png",
    "texture.vertex": "color",
    "texture.uv": "uv1",
    "vertex_values.vertex": "color",
    "column.file": "sun.csv",
    "column.column": "height",
    "sequence.file": "'wave.{number:04d}.obj'",
    "sequence.number": "frame / 2",
    "step.keys": "{0: phong, 24: ward}",
    "spot.attenuation": "{law: windowed, range: 10}",
    "max_distance": "0.5r",
    "formula.parameters": "{diffuse: 0.3, shine: 40}",
    "formula.response": "diffuse / pi * n_l",
    "formula.specular": "0.2 * max(0, 1 - gap_rv)**shine",
    "formula.claims": "[reciprocal]",
    "formula.formula": "exp(-(tan(theta) / 0.2)**2)",
    "lafortune.further": "[{cx: 0.9, cy: 0.9, exponent: 8}]",
    "text.text": "Ward",
    "table.file": "slopes.csv",
    "disc.file": "facets.png",
    "profile.file": "groove.png",
    "merl.file": "gold-metallic-paint.binary",
    "rgl.file": "paint_rgb.bsdf",
}
"""Examples of keys, by description or for all, where no scene has one and the schema does not tell one."""


def example(part: Part, fact: Fact) -> str:
    """A value that the key takes, where no scene has one."""
    name = f"{part.name}.{fact.key}"
    if written := WRITTEN.get(name) or WRITTEN.get(fact.key):
        return written
    field = alternatives(fact.schema)[0]
    default = fact.schema.get("default")
    if "enum" in field:
        return yaml_words(next(choice for choice in reversed(field["enum"]) if choice != default))
    if field.get("type") == "boolean":
        return yaml_words(not default)
    if field.get("type") == "array":
        return yaml_words([_number(field["items"], None)] * field["minItems"])
    if field.get("type") in ("number", "integer"):
        return yaml_words(_number(field, default))
    if field.get("type") == "string":
        return fact.key
    raise LookupError(
        f"{name}: no scene has it; use it in one, or write an example into docs/sitepages/examples.py"
    )


def _number(field: Schema, default: Any) -> float:
    """A number within the range of a field, other than its default, which may be a list."""
    default = default[0] if isinstance(default, list) else default
    low = field.get("minimum", field.get("exclusiveMinimum", 0))
    value = 2 * default if default else 2 if field["type"] == "integer" else 0.5
    return max(min(value, field.get("maximum", value)), low)
