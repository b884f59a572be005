"""All output layers: a new layer is a row of `LAYERS` and a node that computes its buffer."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, TypeAlias

from illumcli.records import Value

Kind: TypeAlias = Literal["light", "share", "data", "id"]
"""`light`: linear and unbounded; `share`: 0 to 1; both are means over a pixel. `data` and `id` (integers) are
not filtered: they are the value of the sample nearest to the pixel's centre, in 32 bits."""
Preview: TypeAlias = Literal["value", "direction", "position", "depth", "fraction", "number"]
"""How a layer that is not light is shown in 8 bits; `film.preview` has a row for each."""


class Layer(Value):
    """A layer of the image."""

    name: str
    buffer: str  # of the render graph, with the layer's values
    channels: tuple[str, ...]  # full channel names, in order
    kind: Kind = "light"
    preview: Preview = "value"
    signed: bool = False  # may be negative
    white: float = 1.0  # the number that the preview `value` shows as white
    per_pixel: bool = False  # computed from complete blocks of finished pixels, not from samples
    text: str = ""  # what it holds, for the schema

    @property
    def data(self) -> bool:
        """True if it is not filtered."""
        return self.kind in ("data", "id")


class PerLight(Value):
    """A name for one layer per light."""

    name: str
    layer: Layer  # of the light `{light}`
    text: str  # what these layers hold

    def of(self, light: str) -> Layer:
        """The layer of the light of this name."""
        names = (self.layer.name, self.layer.buffer, *self.layer.channels)
        name, buffer, *channels = (text.replace(LIGHT, light) for text in names)
        return replace(self.layer, name=name, buffer=buffer, channels=tuple(channels))

    @property
    def prefix(self) -> str:
        """The part before the light's name in the names of its layer and channels."""
        return self.layer.name.partition(LIGHT)[0]


def _channels(group: str, names: str) -> tuple[str, ...]:
    return tuple(f"{group}.{name}" for name in names)


LIGHT = "{light}"
"""Placeholder for the name of a light."""
# fmt: off
LAYERS: tuple[Layer | PerLight, ...] = (
    Layer("beauty", "beauty", ("R", "G", "B"), text="the picture."),
    Layer("ambient", "ambient", _channels("ambient", "RGB"), text="its ambient light alone."),
    Layer("diffuse", "diffuse", _channels("diffuse", "RGB"), text="the diffuse lobes under all lights."),
    Layer("specular", "specular", _channels("specular", "RGB"), text="the highlights under all lights."),
    Layer("emission", "emission", _channels("emission", "RGB"), text="what surfaces emit."),
    PerLight("lights", Layer("{light}", "light:{light}", _channels("{light}", "RGB")),
             text="the light of every lamp by itself, a layer each."),
    PerLight("shadows", Layer("shadow.{light}", "shadow:{light}", _channels("shadow.{light}", "Y"), "share"),
             text="1 where a lamp reaches, 0 in its shadow, a layer each."),
    Layer("obscurance", "obscurance", _channels("obscurance", "Y"), "share", text="w, 1 where open."),
    Layer("alpha", "alpha", ("A",), "share", text="the share of the pixel that is covered."),
    Layer("depth", "depth", ("Z",), "data", "depth", text="distance from the eye's plane [scene units]."),
    Layer("position", "world_position", _channels("P", "XYZ"), "data", "position", signed=True,
          text="of the surface [scene units]."),
    Layer("normal", "normal", _channels("N", "XYZ"), "data", "direction", signed=True,
          text="the one that is shaded with."),
    Layer("geometric_normal", "geometric_normal", _channels("Ng", "XYZ"), "data", "direction", signed=True,
          text="the polygon's own."),
    Layer("uv", "uv", _channels("uv", "UV"), "data", "fraction", signed=True, text="texture coordinates."),
    Layer("object_id", "object_id", _channels("objectId", "Y"), "id", "number",
          text="number of the object, from 1."),
    Layer("material_id", "material_id", _channels("materialId", "Y"), "id", "number",
          text="number of the material, from 1."),
    Layer("triangle_id", "triangle_id", _channels("triangleId", "Y"), "id", "number",
          text="number of the triangle, from 1."),
    Layer("error", "error", _channels("error", "Y"), "data", per_pixel=True,
          text="one standard error of the pixel's luminance."),
)
# fmt: on
"""In the order in which they are listed to users."""

NAMES = tuple(row.name for row in LAYERS)
FIXED = {row.name: row for row in LAYERS if isinstance(row, Layer)}
"""The layers that any scene has."""
PER_LIGHT = {row.name: row for row in LAYERS if isinstance(row, PerLight)}
"""The layers that each light adds."""
CHANNEL_GROUPS = {
    channel.partition(".")[0]: layer.name for layer in FIXED.values() for channel in layer.channels
} | {row.prefix.rstrip("."): row.name for row in PER_LIGHT.values() if row.prefix}
"""Part of a channel's name before the dot, or the name without a dot -> its layer."""


def layer_of_channel(channel: str) -> Layer:
    """The layer that a channel of an image file is part of."""
    name = CHANNEL_GROUPS.get(channel.partition(".")[0], "lights")
    if name in FIXED:
        return FIXED[name]
    row = PER_LIGHT[name]
    light = channel.removeprefix(row.prefix)
    return row.of(light.rpartition(".")[0] or light)


def owner_of(name: str) -> str | None:
    """The layer that a light of this name would collide with; None if the name is free.

    A light's name becomes the name of a layer, and so of files, whose case some systems ignore, and of a
    group of channels.
    """
    folded = name.casefold()
    return folded if folded in NAMES else CHANNEL_GROUPS.get(name)
