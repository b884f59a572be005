"""Limits of textures, checked before any texel is computed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from illumcli.baking.settings import BakeSettings
from illumcli.baking.texture_slots import Slot, slot_triangles
from illumcli.errors import InputError
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.memory import refuse_beyond

TEXEL_BYTES = 400
"""Bytes of memory per texel on the surface: 382 measured, with reconstruction."""
MOST_LAYERS = 64
"""How often uv may cover their texture on average."""


def refuse_large_textures(
    place: str, geometry: SceneGeometry, slots: Sequence[Slot], settings: BakeSettings
) -> None:
    """Raise LimitError if the texels do not fit into memory, and InputError for uv that cover a texture more
    than `MOST_LAYERS` times."""
    assert settings.texture is not None
    total, problems = 0.0, []
    for slot in slots:
        area = 1.0
        if settings.unwrap is None or (settings.unwrap == "missing" and _has_uv(geometry, slot)):
            area = uv_area(geometry, slot)
        total += area
        if area > MOST_LAYERS:
            fact = f"the uv of {slot.name} cover the texture {area:.3g} times"
            problems.append(f"{place}: {fact}, as those of a pattern that repeats; --unwrap all makes others")
    if problems:
        raise InputError(problems)
    width, height = settings.texture
    texels = int(total * width * height)
    refuse_beyond(TEXEL_BYTES * texels, f"{place}: {texels} texels", "choose a smaller --texture")


def uv_area(geometry: SceneGeometry, slot: Slot) -> float:
    """Area of a slot's triangles in uv: 1 if they cover the texture once."""
    placed = geometry.placed[slot.object]
    mesh = placed.mesh
    if mesh.uvs is None or mesh.corner_uvs is None:
        return 0.0
    corners = mesh.corner_uvs[
        geometry.corners[slot_triangles(geometry, slot)] - np.int32(placed.first_corner)
    ]
    a, b, c = (mesh.uvs[corners[(corners >= 0).all(axis=1), k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return float(np.abs(ux * vy - uy * vx).sum() / 2)


def _has_uv(geometry: SceneGeometry, slot: Slot) -> bool:
    return geometry.placed[slot.object].mesh.uvs is not None
