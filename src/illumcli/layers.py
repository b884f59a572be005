"""Every output layer once: a new layer is a row of `LAYERS` and a node that makes its buffer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from illumcli.records import Value

Kind: TypeAlias = Literal["light", "share", "data", "id"]
"""`light`: linear and unbounded; `share`: 0 to 1; both are means over a pixel. `data` and `id`,
whole numbers, are never filtered: the sample nearest to the pixel's centre, in 32 bits."""
Preview: TypeAlias = Literal["value", "direction", "position", "depth", "fraction", "number"]
"""How a layer that is no light is shown in 8 bits; `film.preview` has a row for each."""


class Layer(Value):
    """A layer of the image."""

    name: str
    buffer: str  # of the render graph, which fills it
    channels: tuple[str, ...]  # full channel names, in order
    kind: Kind = "light"
    preview: Preview = "value"
    signed: bool = False  # may be negative
    per_pixel: bool = False  # made pixel by pixel from whole blocks of pixels

    @property
    def data(self) -> bool:
        """Is it never filtered?"""
        return self.kind in ("data", "id")


class PerLight(Value):
    """A name that stands for one layer per light."""

    name: str
    layer: Callable[[str], Layer]  # of the light of a name


def _channels(group: str, names: str) -> tuple[str, ...]:
    return tuple(f"{group}.{name}" for name in names)


def of_light(light: str) -> Layer:
    """The light that one light alone makes."""
    return Layer(light, f"light:{light}", _channels(light, "RGB"))


def shadow_of(light: str) -> Layer:
    """Where one light arrives."""
    return Layer(f"shadow.{light}", f"shadow:{light}", _channels(f"shadow.{light}", "Y"), "share")


LAYERS: tuple[Layer | PerLight, ...] = (
    Layer("beauty", "beauty", ("R", "G", "B")),
    Layer("ambient", "ambient", _channels("ambient", "RGB")),
    Layer("diffuse", "diffuse", _channels("diffuse", "RGB")),
    Layer("specular", "specular", _channels("specular", "RGB")),
    Layer("emission", "emission", _channels("emission", "RGB")),
    PerLight("lights", of_light),
    PerLight("shadows", shadow_of),
    Layer("obscurance", "obscurance", _channels("obscurance", "Y"), "share"),
    Layer("alpha", "alpha", ("A",), "share"),
    Layer("depth", "depth", ("Z",), "data", "depth"),
    Layer("position", "world_position", _channels("P", "XYZ"), "data", "position", signed=True),
    Layer("normal", "normal", _channels("N", "XYZ"), "data", "direction", signed=True),
    Layer("geometric_normal", "geometric_normal", _channels("Ng", "XYZ"), "data", "direction", signed=True),
    Layer("uv", "uv", _channels("uv", "UV"), "data", "fraction", signed=True),
    Layer("object_id", "object_id", _channels("objectId", "Y"), "id", "number"),
    Layer("material_id", "material_id", _channels("materialId", "Y"), "id", "number"),
    Layer("triangle_id", "triangle_id", _channels("triangleId", "Y"), "id", "number"),
    Layer("error", "error", _channels("error", "Y"), "data", per_pixel=True),
)
"""In the order in which they are listed to users."""

NAMES = tuple(row.name for row in LAYERS)
FIXED = {row.name: row for row in LAYERS if isinstance(row, Layer)}
"""The layers that any scene has."""
PER_LIGHT = {row.name: row.layer for row in LAYERS if isinstance(row, PerLight)}
"""Those that each light adds."""
CHANNEL_GROUPS = {
    channel.partition(".")[0]: layer.name for layer in FIXED.values() for channel in layer.channels
} | {"shadow": "shadows"}
"""What stands before the dot of a channel's name, or a channel without one, and its layer."""


def layer_of_channel(channel: str) -> Layer:
    """The layer that a channel of an image file is part of."""
    group, _, name = channel.partition(".")
    if group == "shadow":
        return shadow_of(name.rpartition(".")[0])
    return FIXED[CHANNEL_GROUPS[group]] if group in CHANNEL_GROUPS else of_light(group)


def owner_of(name: str) -> str | None:
    """The layer that a light of this name would collide with; None where the name is free.

    A light's name becomes that of a layer, so of files, on some systems without regard to case, and of a
    group of channels.
    """
    folded = name.casefold()
    return folded if folded in NAMES else CHANNEL_GROUPS.get(name)
