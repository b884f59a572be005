"""Parameters of materials: their ranges, and the textures and vertex values that may replace a constant."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import Discriminator, Field, Tag

from illumcli.schema.annotations import field_annotation, split
from illumcli.schema.description import Description
from illumcli.schema.fields import Color, Shorthand, Triple, spread


class Texture(Description):
    """An image looked up by the surface's uv."""

    texture: str
    """Path of the image, from the scene's folder."""
    space: Literal["srgb", "linear"] | None = None
    """Colour space of the file's numbers; by default linear for floats, as in EXR and HDR, and sRGB for
    integers. `srgb`: the sRGB curve. `linear`: no curve, for integers that are data, such as most scalars."""
    filter: Literal["bilinear", "nearest"] = "bilinear"
    """`bilinear`: interpolate between the four nearest texels. `nearest`: take the nearest texel."""
    wrap: Literal["repeat", "clamp", "mirror"] = "repeat"
    """How uv outside of 0..1 are treated. `repeat`: the image is repeated. `clamp`: its border is extended.
    `mirror`: it is repeated, every second time mirrored."""
    channel: Literal["r", "g", "b", "a"] = "r"
    """The channel that a scalar parameter reads. `r`: red, or grey. `g`: green. `b`: blue. `a`: alpha."""
    factor: Color = (1.0, 1.0, 1.0)
    """Factor on each value; a scalar parameter takes the first number."""
    vertex: str | None = None
    """Name of a per-vertex attribute that multiplies each value, too, such as vertex colours."""
    uv: str | None = None
    """Name of a per-vertex attribute of two numbers, the texture coordinates; by default the mesh's uv."""


class VertexValues(Description):
    """A per-vertex attribute of the mesh, interpolated over each triangle."""

    vertex: str
    """Name of the attribute: `color` for vertex colours, or a scalar property of the file."""
    factor: Color = (1.0, 1.0, 1.0)
    """Factor on each value; a scalar parameter takes the first number."""


def _kind(value: Any) -> str:
    if isinstance(value, Texture) or (isinstance(value, dict) and "texture" in value):
        return "texture"
    if isinstance(value, VertexValues) or (isinstance(value, dict) and "vertex" in value):
        return "vertex"
    return "value"


T = TypeVar("T")
# a constant, a texture or vertex values
Varying: TypeAlias = Annotated[
    Annotated[T, Tag("value")] | Annotated[Texture, Tag("texture")] | Annotated[VertexValues, Tag("vertex")],
    Discriminator(_kind),
]


@cache
def may_vary(cls: type[Description], name: str) -> bool:
    """True if a parameter of this name takes a texture or vertex values."""
    _, marks = split(field_annotation(cls, name))
    return any(isinstance(mark, Discriminator) and mark.discriminator is _kind for mark in marks)


# a slope; a lobe narrower than 1e-4 cannot be resolved in single precision
Roughness: TypeAlias = Annotated[float, Field(ge=1e-4, le=10)]
# an angle in radians, less than a quarter turn
HalfHeight: TypeAlias = Annotated[float, Field(ge=1e-4, le=1.57)]
# the spread of facet slopes, an angle in radians up to a quarter turn
Spread: TypeAlias = Annotated[float, Field(ge=0, le=1.5708)]
# indices of refraction
Index: TypeAlias = Annotated[float, Field(ge=0.01, le=1e3)]
IndexColor: TypeAlias = Annotated[Triple[Index], Shorthand(spread)]
ExtinctionColor: TypeAlias = Annotated[Triple[Annotated[float, Field(ge=0, le=1e3)]], Shorthand(spread)]
