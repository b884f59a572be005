"""Materials in the terms of glTF's metallic-roughness model, as writers take them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from illumcli.records import Value

Color = tuple[float, float, float]


class PbrMaterial(Value):
    """One material. A texture replaces or multiplies nothing unless said."""

    name: str
    base_color: Color = (1.0, 1.0, 1.0)  # linear; not used with the texture `base_color`
    alpha: float = 1.0
    metallic: float = 0.0
    roughness: float = 1.0
    emission: Color = (0.0, 0.0, 0.0)  # linear; multiplied by the texture `emission`
    textures: Mapping[str, str] = field(default_factory=dict)
    """`base_color`, `emission`, `normal` -> an image file, or ``FILE#images[N]``."""
    clamped: tuple[str, ...] = ()  # textures that do not repeat
    has_texture_alpha: bool = False  # the alpha of the texture `base_color` counts
    left_out: tuple[str, ...] = ()  # statements of the source that have no counterpart
