"""The pages of the illumination models, from their docstrings: formula, source, parameters, plots, claims."""

from __future__ import annotations

import re
import runpy
import textwrap
from collections.abc import Iterator
from typing import Any, NamedTuple

import illumcli as illum
from illumcli.commands.schema_generator import schema_of
from illumcli.models._base import CLAIMS
from illumcli.schema.families import members, tag_of
from sitepages import facts
from sitepages.drawing import SOURCE, Drawing, digest_of
from sitepages.examples import Examples
from sitepages.formulas import FormulaError, mathml
from sitepages.scene_reference import ELSEWHERE, keys, sections
from sitepages.source import DOCS, with_links

PACKAGE = "illumcli.models"
FACETS = ("D", "F", "p")
"""Tags of descriptions that several models share."""
NEEDED = {
    "cook_torrance": "-D 'distribution={D: beckmann, m: 0.2}'",
    "formula": "-D 'parameters={diffuse: 0.3, shine: 40}' -D 'response=diffuse / pi * n_l' "
    "-D 'specular=0.5 * max(0, 1 - gap_rv)**shine'",
    "generated": "-D 'distribution={p: formula, formula: \"exp(-(tan(theta) / 0.2)**2)\"}'",
}
"""Model -> options without which there is nothing to draw, or no parameter to change."""
MEASURED = ("merl", "rgl")
"""Models that need a file of somebody else, and are not drawn."""
SPHERES = {
    "ashikhmin_shirley": {"exponent_u": "10 100 1000 10000"},
    "blinn_phong": {"exponent": "4 16 64 256"},
    "burley": {"roughness": "0 0.3 0.6 1"},
    "cook_torrance": {"distribution.m": "0.1 0.2 0.3 0.5"},
    "eon": {"roughness": "0 0.3 0.6 1"},
    "fujii": {"roughness": "0 0.3 0.6 1"},
    "kajiya_kay": {"exponent": "4 16 64 256"},
    "lafortune": {"exponent": "5 20 80 320"},
    "metallic_roughness": {"roughness": "0.1 0.3 0.6 1", "metallic": "0 0.3 0.7 1"},
    "minnaert": {"k": "0.5 0.7 1 1.5"},
    "oren_nayar": {"sigma": "0 0.3 0.6 1"},
    "phong": {"exponent": "4 16 64 256"},
    "poulin_fournier": {"slope": "0.1 0.5 1 1.4"},
    "principled": {"roughness": "0.1 0.3 0.6 1", "metallic": "0 0.3 0.7 1", "clearcoat": "0 0.3 0.6 1"},
    "strauss": {"smoothness": "0.2 0.5 0.8 0.95", "metalness": "0 0.3 0.7 1"},
    "ward": {"alpha_x": "0.05 0.1 0.2 0.4", "alpha_y": "0.05 0.1 0.2 0.4"},
}
"""Model -> parameter -> the values that its lit spheres show."""
REST = """
```{{toctree}}
:hidden:

{pages}
models/facets
```
"""
FACETS_HEAD = """\
# Facets: distributions and Fresnel's law

What [cook_torrance](cook_torrance.md) and [generated](generated.md) are made of: how facets are distributed
(`D`, `p`), and what one of them reflects (`F`).
"""


class Figure(NamedTuple):
    """A picture of a model, and the command that draws it."""

    file: str
    command: str
    text: str


def pages(examples: Examples) -> dict[str, str]:
    """Name -> text of the pages of models."""
    classes = members(PACKAGE)
    written = {f"models/{tag_of(cls)}.md": page(cls, examples) for cls in classes}
    below: dict[str, facts.Part] = {}
    definitions: dict[str, Any] = {}
    for cls in classes:
        schema = schema_of(cls)
        definitions |= schema.get("$defs", {})
        below |= facts.parts_below(schema, lambda title, part: part.tag in FACETS)
    parts = sorted(below.values(), key=lambda part: FACETS.index(part.tag))
    written["models/facets.md"] = "\n".join([FACETS_HEAD, *sections(definitions, parts, examples)])
    written["models.md"] = overview()
    return written


def overview() -> str:
    """The page of all models: what docs/models.md has before its sections."""
    make = runpy.run_path(str(DOCS / "make_models.py"))
    text = with_links(make["text"]().partition("\n## ")[0], DOCS / "models.md")
    rest = REST.format(pages="\n".join(f"models/{tag_of(cls)}" for cls in members(PACKAGE)))
    return "(illumination-models)=\n" + re.sub(r"\]\(#(\w+)\)", r"](models/\1.md)", text) + "\n" + rest


def page(cls: Any, examples: Examples) -> str:
    """The page of one model."""
    tag = tag_of(cls)
    model = illum.models(tag)
    lines = [
        f"(model-{tag.replace('_', '-')})=",
        f"# {model.title} (`{tag}`)",
        "",
        f"```{{index}} ! {model.title.partition(',')[0]}\n```",
        "",
        f"{model.text[0].upper()}{model.text[1:]}",
        "",
    ]
    for figure in figures(tag):
        lines += [f"![{figure.text}]({figure.file})", ""]
    lines += ["## Formula", "", *map(paragraph, model.formula.split("\n\n")[1:])]
    lines += ["## Claims", ""]
    lines += [
        f"- {'**yes**' if getattr(cls, claim) else 'no'}, {claim}: {text}" for claim, text in CLAIMS.items()
    ]
    schema = schema_of(cls)
    own = facts.parts_below(schema, lambda title, part: title not in ELSEWHERE and part.tag not in FACETS)
    lines += ["", "## Parameters", "", *keys(facts.part_of(schema), schema.get("$defs", {}), examples)]
    lines += sections(schema.get("$defs", {}), own.values(), examples)
    lines += ["## References", "", *(f"- {escaped(each)}" for each in model.sources), ""]
    lines += [
        "## Try it",
        "",
        "```sh",
        f"illum models {tag}",
        *(each.command for each in figures(tag)),
        "```",
    ]
    return "\n".join(lines) + "\n"


def paragraph(text: str) -> str:
    """A paragraph in Markdown: formulas, a table as it stands, or words."""
    if re.match(r"\S+( \S+)? = ", text) or re.match(r"\S+\s+= ", text):
        try:
            return f"```{{raw}} html\n{mathml(text)}\n```\n"
        except FormulaError:
            pass
    if text.startswith("    "):
        return f"```text\n{textwrap.dedent(text)}\n```\n"
    return escaped(text) + "\n"


def escaped(text: str) -> str:
    """Words without meaning for Markdown, but for code in backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part[:1] == "`" else re.sub(r"([*<>\[\]|])", r"\\\1", part) for part in parts)


def figures(tag: str) -> list[Figure]:
    """The pictures of a model."""
    return list(_figures(tag))


def _figures(tag: str) -> Iterator[Figure]:
    if tag in MEASURED:
        return
    needed = f" {NEEDED[tag]}" if tag in NEEDED else ""
    lobe = f"{tag}.png"
    yield Figure(
        lobe,
        f"illum brdf {tag}{needed} --view polar --view lobe -o {lobe}",
        "Slices through the BRDF in the plane of incidence, and the lobe in space",
    )
    for parameter, values in SPHERES.get(tag, {}).items():
        numbers = values.split()
        file = f"{tag}-{parameter.replace('.', '-')}.png"
        settings = " ".join(f"-D {k + 1}.{parameter}={value}" for k, value in enumerate(numbers))
        labels = " ".join(f"--label '{parameter} {value}'" for value in numbers)
        models = " ".join([tag] * len(numbers))
        yield Figure(
            file,
            f"illum brdf {models}{needed} {settings} {labels} --view sphere --width 7 -o {file}",
            f"Spheres with {parameter} {', '.join(numbers)}",
        )


def drawings() -> list[Drawing]:
    """The pictures of all models."""
    sources = digest_of([*(SOURCE / "models").glob("*.py"), *(SOURCE / "brdf").glob("*.py")])
    return [
        Drawing(f"models/{figure.file}", figure.command, sources)
        for cls in members(PACKAGE)
        for figure in figures(tag_of(cls))
    ]
