"""Names of the images of a sweep."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.errors import InputError
from illumcli.files.names import fields
from illumcli.scene.variants import LABEL, Variant


def default_pattern(variants: Sequence[Variant]) -> str:
    """A pattern that names every variant: by frame if frames differ, otherwise by the names that differ."""
    if len({variant.frame for variant in variants}) > 1:
        return "{scene}.{frame:04d}.png"
    differ = [
        path for path in variants[0].names if len({variant.names.get(path) for variant in variants}) > 1
    ]
    return "{scene}" + "".join(f"-{{{name}}}" for name in differ) + ".png"


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
