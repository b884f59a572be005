"""Names of the images of a sweep."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.errors import InputError
from illumcli.files.names import fields
from illumcli.scene.variants import Variant


def default_pattern(variants: Sequence[Variant]) -> str:
    """A name that tells the variants apart: by frame where they differ, else by every value that does."""
    if len({variant.frame for variant in variants}) > 1:
        return "{scene}.{frame:04d}.png"
    differ = [
        name for name in variants[0].values if len({variant.values.get(name) for variant in variants}) > 1
    ]
    return "{scene}" + "".join(f"-{{{name}}}" for name in differ) + ".png"


def refuse_equal_names(variants: Sequence[Variant], pattern: str) -> None:
    """Raise InputError where a pattern must give several variants one name; no scene is read for it.

    A scene may still have equal names: those of values that are written differently, of cameras and layers.
    """
    # camera and layer tell variants apart that change them
    named = fields(pattern)
    if named & {"camera", "layer"} and any(
        path.partition(".")[0] in ("camera", "cameras", "outputs") for path in variants[0].values
    ):
        return
    # variants by what of them is in the name
    same: dict[tuple[str | int | None, ...], list[int]] = {}
    used = [path for path in variants[0].values if path in named]
    for number, variant in enumerate(variants, 1):
        values = [variant.values.get(path) for path in used]
        same.setdefault((*values, variant.frame if "frame" in named else None), []).append(number)

    # any two that have all of it in common
    for numbers in same.values():
        if len(numbers) > 1:
            listed = ", ".join(map(str, numbers[:5])) + (", ..." if len(numbers) > 5 else "")
            advice = "add a field to the pattern in which they differ"
            if variants[numbers[0] - 1] == variants[numbers[1] - 1]:
                advice = "they are equal; give each value once"
            raise InputError(f"{pattern}: the name of {len(numbers)} variants ({listed}); {advice}")
