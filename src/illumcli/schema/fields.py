"""Types of fields: numbers with a range, vectors, colours, names, each with its error message.

Ranges are pydantic's (`Field(ge=0)`); their messages are in `messages`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, GetJsonSchemaHandler, Strict

from illumcli.schema.messages import describe, short

LARGEST = 1e18  # squares and products of three such numbers stay finite in float32's exponent range

T = TypeVar("T")
if TYPE_CHECKING:
    ListOf: TypeAlias = Sequence[T]  # an editor takes a list, too
else:
    ListOf: TypeAlias = Annotated[tuple[T, ...], Strict(False)]
"""A list of any length."""

Number: TypeAlias = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
NonNegative: TypeAlias = Annotated[float, Field(ge=0, le=LARGEST)]
Positive: TypeAlias = Annotated[float, Field(gt=0, le=LARGEST)]
Share: TypeAlias = Annotated[float, Field(ge=0, le=1)]

Pair: TypeAlias = Annotated[tuple[T, T], Strict(False)]
Triple: TypeAlias = Annotated[tuple[T, T, T], Strict(False)]
Vector: TypeAlias = Triple[Number]


@dataclass(frozen=True, eq=False)
class Shorthand:
    """Annotation of a list that has a short form, which a function expands before validation."""

    expand: Callable[[Any], Any]
    texts: dict[str, Any] | None = None
    """The JSON schema of texts that are a short form, besides one number."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return BeforeValidator(self.expand).__get_pydantic_core_schema__(source, handler)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        listed = handler(schema)
        return {"anyOf": [listed["items"], *([self.texts] if self.texts else []), listed]}


def spread(value: Any) -> Any:
    """One number as three equal ones; anything else unchanged."""
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


HEX = "^#([0-9A-Fa-f]{3}|[0-9A-Fa-f]{6})$"
"""A colour as in style sheets; each of three digits is short for two equal ones."""
SRGB = {
    "type": "string",
    "pattern": HEX,
    "description": "A colour in sRGB, made linear: '#rrggbb', or '#rgb' for equal digits.",
}
COLOR = "one number, three numbers or '#rrggbb' in quotes"


def color(value: Any) -> Any:
    """The three linear numbers of a colour: from one number, three numbers, or text like `#ff8800` in sRGB.

    Raises
    ------
    ValueError
        The value is none of these.
    """
    if isinstance(value, str) and re.fullmatch(HEX, value):
        digits = value[1:] if len(value) == 7 else "".join(2 * digit for digit in value[1:])
        return tuple(_linear(int(digits[k : k + 2], 16) / 255) for k in (0, 2, 4))
    listed = spread(value)
    if not isinstance(listed, list | tuple) or len(listed) != 3:
        given = f"a list of {len(value)}" if isinstance(value, list | tuple) else describe(value)
        raise ValueError(f"must be {COLOR}, is {given}")
    return listed


def _linear(code: float) -> float:
    """Linear light of an sRGB value: `color.from_srgb` without numpy."""
    return code / 12.92 if code <= 0.04045 else float(((code + 0.055) / 1.055) ** 2.4)


Color: TypeAlias = Annotated[Triple[NonNegative], Shorthand(color, SRGB)]
Albedo: TypeAlias = Annotated[Triple[Share], Shorthand(color, SRGB)]


def _nonzero(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(vector):
        raise ValueError("must not be the zero vector")
    return vector


Direction: TypeAlias = Annotated[Vector, AfterValidator(_nonzero)]


NAME = r"^[A-Za-z_][\w-]*$"


def _name(text: str) -> str:
    if not re.fullmatch(NAME, text):
        raise ValueError(f"'{short(text)}' is no name; use letters, digits, _ and -, and no digit or - first")
    return text


Name: TypeAlias = Annotated[str, AfterValidator(_name), Field(json_schema_extra={"pattern": NAME})]
