"""Warnings about the values of a bake."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.baking.context import BakedChannels, PointChannels
from illumcli.baking.files import ASSETS
from illumcli.baking.inputs import BakeWork
from illumcli.baking.sampling import MAX_SAMPLES
from illumcli.baking.texel_points import TexturePoints
from illumcli.files.journal import Journal
from illumcli.mesh_files.color_change import COLOR_CHANGES

DARK, MOSTLY = 0.01, 0.9
"""If more than the share `MOSTLY` of the values is below `DARK`, the mesh seems to be inside out."""


def warnings_of(values: BakedChannels) -> list[str]:
    """Warnings about targets that were not reached, a mesh that seems to be inside out, and uv."""
    warnings = [line for each in values.of_points for line in _of_points(each)]
    textures = () if values.at_texels is None else values.at_texels.texels.textures
    return list(dict.fromkeys([*warnings, *(line for each in textures for line in uv_warnings(each))]))


def _of_points(values: PointChannels) -> list[str]:
    warnings = []
    for name, statistics in values.statistics.items():
        target = statistics.target
        if target is None or statistics.rmse <= target:
            continue
        at_limit = max(statistics.samples, default=0) >= MAX_SAMPLES
        reason = f"no point casts more than {MAX_SAMPLES} rays" if at_limit else "trials did not reach it"
        warnings.append(f"error of {name} {statistics.rmse:.2g} is above the {target:g} asked for: {reason}")
    thickness = values.statistics.get("thickness")
    if thickness is not None and thickness.open:
        warnings.append(
            f"nothing is behind {thickness.open} points, as on open sheets: their thickness is the limit, "
            f"{thickness.scale:g}"
        )
    w = values.channels.get("obscurance")
    dark = 0.0 if w is None else dark_share(w)
    if dark > MOSTLY:
        warnings.append(
            f"{dark:.0%} of the values are 0: the polygons seem to face inwards; turn their winding around, "
            "or give the file outward normals"
        )
    return warnings


def dark_share(w: NDArray[np.float32]) -> float:
    """Share of values below `DARK`."""
    return float(np.mean(w < DARK)) if len(w) else 0.0


def color_warnings(work: BakeWork, due: Sequence[Path]) -> list[str]:
    """A line if vertex colours that the meshes have are replaced."""
    change = COLOR_CHANGES[work.settings.color or "multiply"]
    if change.multiplies or not any(path.suffix.lower() in ASSETS for path in due):
        return []
    has = "alpha" if change.channels == (3,) else "color"
    names = zip(work.scene.object_names(), work.surfaces.geometry.placed, strict=True)
    replaced = [name for name, placed in names if has in placed.mesh.attributes]
    which = ", ".join(("red", "green", "blue", "alpha")[channel] for channel in change.channels)
    line = f"--color {work.settings.color}: replaces {which} of the vertex colours of {', '.join(replaced)}"
    return [line] if replaced else []


def journal_warnings(work: BakeWork, journal: Journal) -> list[str]:
    """A warning if an interrupted bake could not be continued by a next run."""
    if journal.refusal is None:
        return []
    output = work.outputs[0]
    return [f"finished pieces are not kept beside {output} for a next run: {journal.refusal}"]


def uv_warnings(texture: TexturePoints) -> list[str]:
    """Warnings about the uv of a texture: what covers texels several times, or none."""
    name, triangles, overlaps = texture.slot.name, texture.triangles, texture.overlaps
    warnings = []
    if triangles.without_uv:
        fact = f"{triangles.without_uv} triangles have no uv: no texel belongs to them"
        warnings.append(f"{name}: {fact}; --unwrap all makes uv for all")
    if triangles.without_area:
        fact = f"the uv of {triangles.without_area} triangles have no area"
        warnings.append(f"{name}: {fact}: lookups on them read texels of others")
    if triangles.tiles > 1:
        fact = f"the uv reach into {triangles.tiles} tiles"
        warnings.append(f"{name}: {fact}, which are baked into one texture that repeats")
    if overlaps.several:
        share = overlaps.several / overlaps.read
        fact = f"{overlaps.several} texels ({share:.1%}) belong to several places of the surface"
        if overlaps.mirrored:
            fact += f", {overlaps.mirrored} of them to mirrored charts"
        advice = "--unwrap all makes uv that do not overlap"
        warnings.append(f"{name}: {fact}: each has the mean of their values; {advice}")
    return warnings
