"""Parameters of materials: their ranges, and the textures, vertex values and curves over the surface that may
replace a constant."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from illumcli.formula import checked
from illumcli.keyframes import Interpolation
from illumcli.schema.annotations import field_annotation, split
from illumcli.schema.description import Description
from illumcli.schema.fields import Color, ListOf, Number, Positive, Shorthand, Triple, spread


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


def _map_kind(value: Any) -> str:
    if isinstance(value, Texture) or (isinstance(value, dict) and "texture" in value):
        return "texture"
    if isinstance(value, VertexValues) or (isinstance(value, dict) and "vertex" in value):
        return "vertex"
    return "value"


T = TypeVar("T")
# a constant, a texture or vertex values
Mapped: TypeAlias = Annotated[
    Annotated[T, Tag("value")] | Annotated[Texture, Tag("texture")] | Annotated[VertexValues, Tag("vertex")],
    Discriminator(_map_kind),
]
# three numbers, or one for all
Numbers: TypeAlias = Annotated[Triple[Number], Shorthand(spread)]


class Keys(Description):
    """Values at some moments."""

    positions: Annotated[ListOf[Number], Field(min_length=1)]
    """The moments, increasing."""
    values: Annotated[ListOf[ListOf[Number]], Field(min_length=1)]
    """At each moment, a list of one number, or of three."""
    interpolation: Interpolation = "linear"
    """Between moments. `linear`: straight. `smooth`: a cubic. `step`: each value holds until the next."""

    @model_validator(mode="after")
    def _is_a_table(self) -> Keys:
        if len(self.values) != len(self.positions) or {len(row) for row in self.values} not in ({1}, {3}):
            raise ValueError("must have a list of one or three numbers for each position")
        if any(a >= b for a, b in zip(self.positions, self.positions[1:], strict=False)):
            raise ValueError("must have positions that increase")
        return self

    @property
    def width(self) -> int:
        """How many numbers a value has."""
        return len(self.values[0])


def _checked(text: str) -> str:
    return checked(text, ("frame", "time"))


class Formulas(Description):
    """Values computed from the moment."""

    formulas: Annotated[ListOf[Annotated[str, AfterValidator(_checked)]], Field(min_length=1, max_length=3)]
    """One formula of `frame` and `time` [s], or three."""
    over: Literal["frame", "time"] = "frame"
    """What moments are. `frame`: numbers of frames. `time`: seconds."""
    fps: Positive = 24.0
    """Frames per second."""

    @property
    def width(self) -> int:
        """How many numbers a value has."""
        return len(self.formulas)


class CurveOverSurface(Description):
    """A curve with maps at a moment t: scale * phi(rate * t - delay) + offset. Frames make it of `curve`."""

    moment: Number
    """t, in frames or in seconds."""
    phi: Annotated[
        Annotated[Keys, Tag("keys")] | Annotated[Formulas, Tag("formulas")],
        Discriminator(lambda phi: "formulas" if isinstance(phi, Formulas) or "formulas" in phi else "keys"),
    ]
    """The curve."""
    rate: Mapped[Number] = 1.0
    """How fast time passes."""
    delay: Mapped[Number] = 0.0
    """How much later the curve begins, in the unit of t."""
    scale: Mapped[Numbers] = (1.0, 1.0, 1.0)
    """Factor on each value; a scalar parameter takes the first number."""
    offset: Mapped[Numbers] = (0.0, 0.0, 0.0)
    """Added to each value; a scalar parameter takes the first number."""

    def maps(self) -> Iterator[tuple[str, Texture | VertexValues]]:
        """The names and the maps of what varies over the surface."""
        return ((name, value) for name, value in self if isinstance(value, Texture | VertexValues))


def _kind(value: Any) -> str:
    if isinstance(value, CurveOverSurface) or (isinstance(value, dict) and "phi" in value):
        return "curve"
    return _map_kind(value)


OverSurface: TypeAlias = Texture | VertexValues | CurveOverSurface
# a constant, or what varies over the surface
Varying: TypeAlias = Annotated[
    Annotated[T, Tag("value")]
    | Annotated[Texture, Tag("texture")]
    | Annotated[VertexValues, Tag("vertex")]
    | Annotated[CurveOverSurface, Tag("curve")],
    Discriminator(_kind),
]


def maps_of(value: OverSurface) -> tuple[Texture | VertexValues, ...]:
    """The textures and vertex values that a parameter reads: itself, or the maps of a curve."""
    return tuple(each for _, each in value.maps()) if isinstance(value, CurveOverSurface) else (value,)


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
