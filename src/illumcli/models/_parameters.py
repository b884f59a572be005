"""Parameters of materials: their ranges, and what may stand for one that varies over the surface."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import Discriminator, Field, Tag

from illumcli.schema.description import Description
from illumcli.schema.fields import Color, Shorthand, Triple, spread


class Texture(Description):
    """An image looked up by the surface's uv."""

    texture: str
    """Path of the image, from the scene's folder."""
    space: Literal["srgb", "linear"] | None = None
    """How the file's numbers code light; by default linear where they are floats, as in EXR and HDR, and sRGB
    where they are integers. `srgb`: by the sRGB curve, as pictures do. `linear`: as they are, for integers
    that are data, as most scalars."""
    filter: Literal["bilinear", "nearest"] = "bilinear"
    """`bilinear`: between the four texels around. `nearest`: the texel itself."""
    wrap: Literal["repeat", "clamp", "mirror"] = "repeat"
    """What lies outside of uv 0..1. `repeat`: the image again. `clamp`: its border. `mirror`: the image
    again, every second time mirrored."""
    channel: Literal["r", "g", "b", "a"] = "r"
    """The channel a scalar parameter reads. `r`: red, or grey. `g`: green. `b`: blue. `a`: alpha."""
    factor: Color = (1.0, 1.0, 1.0)
    """What each value is multiplied by; a scalar parameter takes the first number."""
    vertex: str | None = None
    """Name of a per-vertex attribute that each value is multiplied by as well, as vertex colours are."""
    uv: str | None = None
    """Name of a per-vertex attribute of two numbers to look the image up by; by default the mesh's own uv."""


class VertexValues(Description):
    """A per-vertex attribute of the mesh, interpolated over each triangle."""

    vertex: str
    """Name of the attribute: `color` for vertex colours, or a scalar property of the file."""
    factor: Color = (1.0, 1.0, 1.0)
    """What each value is multiplied by; a scalar parameter takes the first number."""


def _kind(value: Any) -> str:
    if isinstance(value, Texture) or (isinstance(value, dict) and "texture" in value):
        return "texture"
    if isinstance(value, VertexValues) or (isinstance(value, dict) and "vertex" in value):
        return "vertex"
    return "value"


T = TypeVar("T")
# a value, or what varies over the surface
Varying: TypeAlias = Annotated[
    Annotated[T, Tag("value")] | Annotated[Texture, Tag("texture")] | Annotated[VertexValues, Tag("vertex")],
    Discriminator(_kind),
]

# a slope; below 1e-4 single precision holds no lobe
Roughness: TypeAlias = Annotated[float, Field(ge=1e-4, le=10)]
# an angle in radians, less than a quarter turn
HalfHeight: TypeAlias = Annotated[float, Field(ge=1e-4, le=1.57)]
# the spread of facet slopes, an angle in radians up to a quarter turn
Spread: TypeAlias = Annotated[float, Field(ge=0, le=1.5708)]
# indices of refraction
Index: TypeAlias = Annotated[float, Field(ge=0.01, le=1e3)]
IndexColor: TypeAlias = Annotated[Triple[Index], Shorthand(spread)]
ExtinctionColor: TypeAlias = Annotated[Triple[Annotated[float, Field(ge=0, le=1e3)]], Shorthand(spread)]
