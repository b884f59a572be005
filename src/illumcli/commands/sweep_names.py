"""Names of the images of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.commands.options import RenderOptions
from illumcli.errors import InputError
from illumcli.files.names import fields, frame_field, number_form, with_forms
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.curves._keys import number_in
from illumcli.scene.load import load, read_text
from illumcli.scene.variants import LABEL, Variant


def named(path: Path, variants: Sequence[Variant], options: RenderOptions) -> RenderOptions:
    """The options with the pattern that the images of a sweep are named by."""
    given = options.pattern or default_pattern(variants, fields_of_images(path, variants, options))
    return replace(options, pattern=pattern_of(variants, given))


def pattern_of(variants: Sequence[Variant], given: str) -> str:
    """A pattern in which all numbers of a path have the same width.

    A field with a form of its own keeps it.
    """
    forms = {}
    for path in dict.fromkeys(path for variant in variants for path in variant.values):
        of_path = [variant for variant in variants if path in variant.values]
        texts = dict.fromkeys(variant.values[path] for variant in of_path)
        numbers = [number for text in texts if (number := number_in(text)) is not None]
        is_named = any(variant.names.get(path, variant.values[path]) not in texts for variant in of_path)
        if len(numbers) == len(texts) and not is_named:
            forms[path] = number_form(numbers)
    return with_forms(given, forms)


def fields_of_images(path: Path, variants: Sequence[Variant], options: RenderOptions) -> tuple[str, ...]:
    """The fields in which the PNG images of one variant differ: none, `camera`, `layer` or both.

    One variant without a fault tells, unless cameras or layers vary.
    """
    text, differing = read_text(path), set[str]()
    varies = any(each.partition(".")[0] in ("cameras", "outputs") for each in variants[0].values)
    for variant in variants:
        try:
            scene = load(path, variant.overrides, text, variant.frame).scene
            counts = {"camera": len(scene.named_cameras()), "layer": len(outputs_of(scene, options.only))}
        except InputError:  # reported when it is planned
            continue
        differing |= {name for name, count in counts.items() if count > 1}
        if not varies:
            break
    return tuple(sorted(differing))


def default_pattern(variants: Sequence[Variant], also: Sequence[str] = ()) -> str:
    """A pattern that names every variant: by the names that differ, further fields and the frame."""
    now = [variant.names for variant in variants if variant.frame == variants[0].frame]
    differ = [path for path in now[0] if len({names.get(path) for names in now}) > 1]
    frames = [variant.frame for variant in variants if variant.frame is not None]
    values = "".join(f"-{{{name}}}" for name in differ)
    return "{scene}" + values + "".join(f".{{{name}}}" for name in also) + frame_field(frames) + ".png"


def refuse_equal_names(variants: Sequence[Variant], pattern: str) -> None:
    """Raise InputError if a pattern gives several variants the same name; reads no scene.

    Names may still turn out equal: of equal values that are written differently, of cameras and layers.
    """
    # Variants may differ in cameras or layers, which are in their names.
    named = fields(pattern)
    if named & {"camera", "layer"} and any(
        path.partition(".")[0] in ("camera", "cameras", "outputs") for path in variants[0].values
    ):
        return

    # Group the variants by those of their values that are in the name.
    same: dict[tuple[str | int | None, ...], list[int]] = {}
    used = [path for path in (*variants[0].values, LABEL) if path in named]
    for number, variant in enumerate(variants, 1):
        names = {**variant.values, **variant.names}
        shown = [names.get(path) for path in used]
        same.setdefault((*shown, variant.frame if "frame" in named else None), []).append(number)

    # Refuse groups of several variants.
    for numbers in same.values():
        if len(numbers) > 1:
            listed = ", ".join(map(str, numbers[:5])) + (", ..." if len(numbers) > 5 else "")
            advice = "add a field to the pattern in which they differ"
            if variants[numbers[0] - 1] == variants[numbers[1] - 1]:
                advice = "they are equal; give each value once"
            raise InputError(f"{pattern}: the name of {len(numbers)} variants ({listed}); {advice}")
