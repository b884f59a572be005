"""What a scene may say: each key with its type, range and default in words, from the JSON schema."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from illumcli.schema.docs import unit_in

Schema = Mapping[str, Any]

REFERENCE = "#/$defs/"
UNBOUNDED = 2**31 - 1
"""Limits of this size and above keep numbers finite; they are not worth a word."""
INTERNAL = ("CurveOverSurface",)
"""Descriptions that no scene writes."""


class Part(NamedTuple):
    """A description: a mapping with known keys."""

    name: str
    """Its tag, as in `ward`; otherwise the name of its class, as in `depth_cue`."""
    tag: str
    """The key that holds the tag, as in `model`; empty if it has none."""
    schema: Schema


class Fact(NamedTuple):
    """A key of a description."""

    key: str
    type: str
    unit: str
    range: str
    default: str
    text: str
    schema: Schema


FAMILIES = {
    "model": "[illumination model](#illumination-models)",
    "light": "[light](#scene-lights)",
    "law": "[distance law](#scene-law-none)",
    "shape": "[shape](#scene-shapes)",
    "falloff": "[falloff](#scene-falloffs)",
    "curve": "[curve](#scene-curves)",
    "D": "[facet distribution](#scene-d-beckmann)",
    "F": "[Fresnel's law](#scene-f-schlick)",
    "p": "[density of facets](#scene-p-formula)",
    "projection": "[camera](#scene-projection-perspective)",
}
"""Tag of a family -> the words for any of its members."""


def part_of(schema: Schema) -> Part:
    """A description from its schema."""
    for key, field in schema["properties"].items():
        if isinstance(field.get("const"), str):
            return Part(field["const"], key, schema)
    return Part(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", schema["title"]).lower(), "", schema)


def parts_below(schema: Schema, wanted: Callable[[str, Part], bool]) -> dict[str, Part]:
    """Title -> description, of those wanted that a description refers to, in the order of its keys."""
    definitions = schema.get("$defs", {})
    parts: dict[str, Part] = {}

    def visit(part: Schema) -> None:
        for title in references(part):
            below = part_of(definitions[title])
            if title not in parts and wanted(title, below):
                parts[title] = below
                visit(below.schema["properties"])

    visit(schema["properties"])
    return parts


def references(schema: Any) -> Iterator[str]:
    """The titles of the descriptions that a schema names, in its order."""
    if isinstance(schema, Mapping):
        if "$ref" in schema:
            yield schema["$ref"].removeprefix(REFERENCE)
        for key, part in schema.items():
            if key not in ("$defs", "discriminator"):
                yield from references(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from references(part)


def facts(part: Part, definitions: Schema) -> list[Fact]:
    """The keys of a description, without its tag."""
    required = part.schema.get("required", ())
    return [
        Fact(
            key=key,
            type=type_words(field, definitions),
            unit=unit_in(field.get("description", "")),
            range=range_words(field),
            default="none, required" if key in required else default_words(field),
            text=field.get("description", ""),
            schema=field,
        )
        for key, field in part.schema["properties"].items()
        if key != part.tag
    ]


def alternatives(field: Schema) -> list[Schema]:
    """What a field may be, without null."""
    flat = [each for key in ("anyOf", "oneOf") for each in field.get(key, ())] or [field]
    flat = [inner for each in flat for inner in (alternatives(each) if each is not field else [each])]
    return [each for each in flat if each.get("type") != "null"]


def type_words(field: Schema, definitions: Schema) -> str:
    """The type of a field in words, with links to descriptions."""
    parts = alternatives(field)
    words: list[str] = []
    if any("pattern" in each and each.get("type") == "string" and "#" in each["pattern"] for each in parts):
        words.append("colour")
        parts = [each for each in parts if "$ref" in each or "enum" in each]
    elif len(parts) > 1 and parts[0].get("type") == "number" and parts[1].get("type") == "array":
        words.append("one number or three")
        parts = parts[2:]
    for each in parts:
        if "$ref" in each:
            title = each["$ref"].removeprefix(REFERENCE)
            words += [link(part_of(definitions[title]))] if title not in INTERNAL else []
        else:
            words.append(plain_words(each, definitions))
    return " or ".join(dict.fromkeys(word for word in words if word))


def link(part: Part) -> str:
    """A link to a description's section, or to the page of its family."""
    return FAMILIES.get(part.tag) or f"[{part.name.replace('_', ' ')}](#{anchor(part)})"


def anchor(part: Part) -> str:
    """The anchor of a description's section."""
    return "-".join(filter(None, ["scene", part.tag, part.name])).replace("_", "-").lower()


def plain_words(field: Schema, definitions: Schema) -> str:
    """The type of a field that is neither a description nor a choice of types."""
    if "enum" in field:
        return " or ".join(f"`{choice}`" for choice in field["enum"])
    if "const" in field:
        return f"`{json.dumps(field['const'])}`"
    if field["type"] == "array":
        least, most = field.get("minItems"), field.get("maxItems")
        inner = type_words(field["items"], definitions)
        if least == most and least is not None and inner in ("number", "integer"):
            return f"{least} {inner}s"
        return f"{least} lists of {inner}" if least == most and least is not None else f"list of {inner}"
    if field["type"] == "object":
        inner = next(iter(field.get("patternProperties", {}).values()), None)
        return f"names with {type_words(inner, definitions)}" if inner else "mapping"
    return {"boolean": "`true` or `false`", "string": "text"}.get(field["type"], field["type"])


def range_words(field: Schema) -> str:
    """The range of the numbers of a field, empty if it has none."""
    for each in alternatives(field):
        inner = each
        while inner.get("type") == "array":
            inner = inner["items"]
        if inner.get("type") in ("number", "integer"):
            return _range(inner)
    return ""


def _range(number: Schema) -> str:
    low, above = number.get("minimum"), number.get("exclusiveMinimum")
    high, below = number.get("maximum"), number.get("exclusiveMaximum")
    if low is not None and high is not None and low > -UNBOUNDED and high < UNBOUNDED:
        return f"{low:g} to {high:g}"
    lower = "" if low is None or low <= -UNBOUNDED else f"at least {low:g}"
    upper = "" if high is None or high >= UNBOUNDED else f"at most {high:g}"
    lower = lower if above is None else f"above {above:g}"
    upper = upper if below is None else f"below {below:g}"
    return ", ".join(filter(None, [lower, upper]))


def default_words(field: Schema) -> str:
    """The default of a field in words."""
    if "default" not in field:
        return "that of its keys" if "$ref" in field else "none"
    default = field["default"]
    if default is None:
        return "left out"
    if default == []:
        return "none"
    is_grey = isinstance(default, list) and len(default) == 3 and len(set(map(str, default))) == 1
    if is_grey and any(each.get("type") == "number" for each in alternatives(field)):
        default = default[0]
    return f"`{yaml_words(default)}`"


def yaml_words(value: Any) -> str:
    """A value as a scene would write it, on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {yaml_words(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(yaml_words, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}"
    is_plain = isinstance(value, str) and re.fullmatch(r"[A-Za-z][\w ./-]*", value)
    return value if is_plain else json.dumps(value)
