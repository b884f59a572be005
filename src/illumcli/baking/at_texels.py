"""Channels sampled at the texels of textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, unit
from illumcli.atlas.fill import filled
from illumcli.atlas.triangles import TextureSize
from illumcli.baking.at_points import channels_at
from illumcli.baking.baked_texture import BakedTexture
from illumcli.baking.context import BakeContext, PointChannels, TexelChannels
from illumcli.baking.tangent_space import texel_tangents, to_tangent
from illumcli.baking.texel_points import Texels, TexturePoints, texel_points
from illumcli.baking.texture_slots import Slot
from illumcli.baking.unwrapped import unwrapped_uvs
from illumcli.visibility.channels import CHANNELS


def sampled_at_texels(context: BakeContext, slots: Sequence[Slot]) -> TexelChannels:
    """The channels that the settings ask for, at the texels of the textures of all slots."""
    assert context.settings.texture is not None
    size = TextureSize(*context.settings.texture)
    uvs = unwrapped_uvs(context, slots, size)
    texels = texel_points(context.surfaces, slots, size, uvs, context.threads)
    return TexelChannels(texels, in_tangent_space(texels, channels_at(context, texels.points)), uvs)


def in_tangent_space(texels: Texels, values: PointChannels) -> PointChannels:
    """Values at texels with their directions in tangent space."""
    directions = {name: each for name, each in values.channels.items() if CHANNELS[name].kind == "direction"}
    if not directions:
        return values
    turned = {name: np.empty_like(each) for name, each in directions.items()}
    for texture in texels.textures:
        own = texture.points
        tangents, sign = texel_tangents(texture, texels.points)
        for name, each in directions.items():
            turned[name][own] = to_tangent(each[own], texels.points.n[own], tangents, sign)
    return replace(values, channels={**values.channels, **turned})


def baked_texture(texture: TexturePoints, values: PointChannels) -> BakedTexture:
    """A texture from the values of its points: of a texel with several, their mean; gutters are filled."""
    size = texture.triangles.size
    shape = size.height, size.width
    count = np.bincount(texture.texel, minlength=size.texels)
    several = np.maximum(count, 1)
    is_covered = (count > 0).reshape(shape)

    def of_texels(of_points: NDArray[np.float64]) -> NDArray[np.float32]:
        """(H, W) means over the points of each texel; gutters are filled."""
        means = np.bincount(texture.texel, of_points, size.texels) / several
        return filled(means.astype(F).reshape(shape), is_covered)

    channels = {}
    for name, values_of_all in values.channels.items():
        kind, of_points = CHANNELS[name].kind, values_of_all[texture.points].astype(np.float64)
        if kind == "value":
            channels[name] = of_texels(of_points)
        elif kind == "error":  # different points err independently
            channels[name] = np.sqrt(of_texels(np.square(of_points) / several[texture.texel]))
        else:
            mean = np.stack([of_texels(axis) for axis in of_points.T], axis=-1)
            channels[name] = unit(mean.reshape(-1, 3)).reshape(mean.shape)
    slot = texture.slot
    return BakedTexture(slot.object, slot.material, slot.name, channels, is_covered)
