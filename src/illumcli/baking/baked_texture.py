"""Baked textures: channels over the uv atlas of one material of one object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record


class BakedTexture(Record):
    """Values of the texels of one material of one object, (H, W) each, linear.

    Row 0 is the top of the picture, as in image files. The centre of the texel in row i and column j is at
    u = (j + 0.5) / W, and at v = 1 - (i + 0.5) / H in a `Mesh`, whose v points up; in glTF, whose v points
    down, at v = (i + 0.5) / H. uv outside [0, 1] repeat the texture.

    Texels that no lookup reads have the values of those near them, so that mipmaps mix in no background.
    """

    object: int  # index of the object
    material: int  # index in `material_names` of the object's mesh; -1 for polygons without a material
    name: str  # of the object, and of the material if the object has several: unique among a bake's textures
    channels: Mapping[str, NDArray[np.float32]]
    """(H, W) or, of directions, (H, W, 3), by the names that baked vertices have: `obscurance` (1 where
    open), `standard_error` and so on."""
    is_covered: NDArray[np.bool_]  # (H, W) True where a lookup on the surface reads the texel


class TextureUvs(Record):
    """uv of an object's triangles, where the file's own do not serve. Seams may run inside polygons."""

    uvs: NDArray[np.float64]  # (U, 2) v upwards
    corner_uvs: NDArray[np.int32]  # (T, 3) row of `uvs` at the corners of each, as the geometry has them


class BakedTextures(Record):
    """The textures of a bake."""

    textures: tuple[BakedTexture, ...] = ()
    unwrapped: Mapping[int, TextureUvs] = field(default_factory=dict)
    """Object -> the uv that its textures use, if they are not those of its file."""
    about: Mapping[str, Any] = field(default_factory=dict)
    """What the files say of themselves: the same text as other baked files have."""
