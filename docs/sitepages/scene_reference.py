"""The scene reference: every key of every description, from the descriptions."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from illumcli.commands.schema_generator import schema_of
from illumcli.scene.spec import Scene
from illumcli.schema.families import members
from sitepages import facts
from sitepages.examples import Examples
from sitepages.facts import Part, Schema


class Family(NamedTuple):
    """A page of descriptions that are told apart by a tag."""

    page: str
    package: str
    title: str
    text: str


FAMILIES = (
    Family(
        "scene/lights",
        "illumcli.lights",
        "Lights",
        "Each light of the list `lights` names its kind: `{light: point, position: [3, 4, 3]}`.",
    ),
    Family(
        "scene/shapes",
        "illumcli.geometry.shapes",
        "Shapes",
        "A mesh is a file, or a shape that is built in: `{shape: sphere, radius: 2}`.",
    ),
    Family(
        "scene/falloffs",
        "illumcli.visibility.falloffs",
        "Falloffs of obscurance",
        "How much an occluder counts by its distance: `falloff: {falloff: smooth, max_distance: 3}`. With "
        "`step`, every occluder counts fully up to the distance: this is ambient occlusion. With any other "
        "falloff it is called obscurance.",
    ),
    Family(
        "scene/curves",
        "illumcli.scene.curves",
        "Curves",
        "In a scene with `frames` any value may be a curve: `{curve: formula, value: frame / 48}`. "
        "[Animation](../animation.md) explains them.",
    ),
)
VARYING = ("Texture", "VertexValues")
"""Descriptions that stand where a colour or number of a material may vary."""
ELSEWHERE = (*VARYING, *facts.INTERNAL)
"""Descriptions that have a section on another page, or none."""
HEAD = """\
# Scene reference

Every key of a scene file, with its type, unit, range, default and an example, made from the descriptions that
illum itself checks scenes with. Keys that are not listed are refused, with a suggestion. `illum check` tells
all mistakes of a scene at once, and an editor that knows YAML schemas completes keys with
`# yaml-language-server: $schema=scene.schema.json`, the output of `illum schema`.

A *colour* is one number, three linear numbers, or `"#rrggbb"` in quotes, which is sRGB. `-D` and sweeps name
a key by its path: `film.width`, `materials.clay.sigma`, `lights.0.position`.

Lights, shapes, falloffs, curves and models have pages of their own: {families}, [models](models.md).

```{{toctree}}
:hidden:

{pages}
scene/materials
```
"""
MATERIALS = """\
# Materials that vary

A material is an [illumination model](../models.md) with its parameters. Where the page of a model says so, a
parameter may be a texture or a vertex attribute instead of a constant: `diffuse: {texture: bark.png}`.
"""


def pages(examples: Examples) -> dict[str, str]:
    """Name -> text of the pages of the scene reference."""
    scene = schema_of(Scene)
    families = ", ".join(f"[{each.title.lower()}]({each.page}.md)" for each in FAMILIES)
    head = HEAD.format(families=families, pages="\n".join(each.page for each in FAMILIES))
    untagged = facts.parts_below(scene, lambda title, part: is_own(part) and title not in ELSEWHERE)
    own = [facts.part_of(scene), *untagged.values()]
    varying = [facts.part_of(scene["$defs"][title]) for title in VARYING]
    return {
        "scene.md": "\n".join([head, *sections(scene["$defs"], own, examples)]),
        "scene/materials.md": "\n".join([MATERIALS, *sections(scene["$defs"], varying, examples)]),
        **{f"{family.page}.md": family_page(family, examples) for family in FAMILIES},
    }


def is_own(part: Part) -> bool:
    """Has the description a section on the page of scenes? Those with a tag have pages of their own."""
    return part.tag in ("", "projection")


def family_page(family: Family, examples: Examples) -> str:
    """The page of a family: its members, then the descriptions that they refer to."""
    schemas = [schema_of(cls) for cls in members(family.package)]
    below = {}
    for schema in schemas:
        below |= facts.parts_below(schema, lambda title, _: title not in ELSEWHERE)
    definitions: dict[str, Any] = {}
    for schema in schemas:
        definitions |= schema.get("$defs", {})
    parts = [*map(facts.part_of, schemas), *below.values()]
    head = f"({family.page.replace('/', '-')})=\n# {family.title}\n\n{family.text}\n"
    return "\n".join([head, *sections(definitions, parts, examples)])


def sections(definitions: Schema, parts: Iterable[Part], examples: Examples) -> list[str]:
    """A section for each description, with its keys."""
    return [section(part, definitions, examples) for part in parts]


def section(part: Part, definitions: Mapping[str, Any], examples: Examples) -> str:
    """A description: its heading, its text and its keys."""
    title = f"`{part.tag}: {part.name}`" if part.tag else part.name.replace("_", " ").capitalize()
    lines = [f"({facts.anchor(part)})=", f"## {title}", "", part.schema["description"], ""]
    lines += keys(part, definitions, examples)
    return "\n".join(lines)


def keys(part: Part, definitions: Mapping[str, Any], examples: Examples) -> list[str]:
    """The keys of a description, each with an anchor and an entry in the index."""
    lines = []
    for fact in facts.facts(part, definitions):
        about = {"Type": fact.type, "Unit": fact.unit, "Range": fact.range, "Default": fact.default}
        lines += [f"```{{confval}} {entry(part, fact.key)}"]
        lines += [" · ".join(f"*{name}:* {words}" for name, words in about.items() if words)]
        lines += ["", textwrap.fill(fact.text, 110)] if fact.text else []
        lines += ["", f"*Example:* `{fact.key}: {examples.of(part, fact)}`", "```", ""]
    return lines


def entry(part: Part, key: str) -> str:
    """What the index calls a key: `film.width`, `ward.alpha_x`, `light.point.position`."""
    family = () if part.tag in ("", "model", "projection") else (part.tag,)
    return ".".join([*family, *([] if part.name == "scene" else [part.name]), key])
