"""Every output layer once: its name, what fills it, its channels in a file, the kind of its values."""

from __future__ import annotations

from typing import Literal, TypeAlias

from illumcli.records import Value

Kind: TypeAlias = Literal["light", "share", "data", "id"]
"""`light`: linear and unbounded; `share`: 0 to 1; both are means over a pixel. `data` and `id`,
whole numbers, are never filtered: the sample nearest to the pixel's centre, in 32 bits."""


class Layer(Value):
    """A layer of the picture."""

    name: str
    buffer: str  # what fills it
    channels: tuple[str, ...]  # full channel names, in order
    kind: Kind = "light"
    per_pixel: bool = False  # made pixel by pixel from whole blocks of pixels

    @property
    def data(self) -> bool:
        """Is it never filtered?"""
        return self.kind in ("data", "id")


def _rgb(name: str) -> tuple[str, ...]:
    return tuple(f"{name}.{c}" for c in "RGB")


FIXED = {
    layer.name: layer
    for layer in (
        Layer("beauty", "beauty", ("R", "G", "B")),
        Layer("ambient", "ambient", _rgb("ambient")),
        Layer("diffuse", "diffuse", _rgb("diffuse")),
        Layer("specular", "specular", _rgb("specular")),
        Layer("emission", "emission", _rgb("emission")),
        Layer("obscurance", "obscurance", ("obscurance.Y",), "share"),
        Layer("alpha", "alpha", ("A",), "share"),
        Layer("depth", "depth", ("Z",), "data"),
        Layer("position", "world_position", ("P.X", "P.Y", "P.Z"), "data"),
        Layer("normal", "normal", ("N.X", "N.Y", "N.Z"), "data"),
        Layer("geometric_normal", "geometric_normal", ("Ng.X", "Ng.Y", "Ng.Z"), "data"),
        Layer("uv", "uv", ("uv.U", "uv.V"), "data"),
        Layer("object_id", "object_id", ("objectId.Y",), "id"),
        Layer("material_id", "material_id", ("materialId.Y",), "id"),
        Layer("triangle_id", "triangle_id", ("triangleId.Y",), "id"),
        Layer("error", "error", ("error.Y",), "data", per_pixel=True),
    )
}
"""The layers that any scene has; each light adds two of its own."""
PER_LIGHT = ("lights", "shadows")
"""Names that stand for one layer per light."""


def of_light(name: str) -> Layer:
    """The light that one light alone makes."""
    return Layer(name, f"light:{name}", _rgb(name))


def shadow_of(name: str) -> Layer:
    """Where the light of this name arrives."""
    return Layer(f"shadow.{name}", f"shadow:{name}", (f"shadow.{name}.Y",), "share")


CHANNEL_GROUPS = {
    channel.partition(".")[0]: layer.name for layer in FIXED.values() for channel in layer.channels
} | {"shadow": "shadows"}
"""What stands before the dot of a channel's name, or a channel without one, and its layer."""


def owner_of(name: str) -> str | None:
    """The layer that a light of this name would collide with; None where the name is free.

    A light's name becomes that of a layer, so of files, on some systems without regard to case, and of a
    group of channels.
    """
    folded = name.casefold()
    return folded if folded in (*FIXED, *PER_LIGHT) else CHANNEL_GROUPS.get(name)
