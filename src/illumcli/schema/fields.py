"""What a field of a description may hold: annotations, and the schema of pydantic's core that each names.

`schema_of` puts them together when something is validated. What pydantic itself makes of the same annotations
is equal, but to load what makes it takes a quarter of a small render.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin

from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from illumcli.records import Value

LARGEST = 1e18  # squares and products of three such numbers stay finite in float32's exponent range


def schema_of(kind: Any) -> CoreSchema:
    """The schema of an annotation's values: of a class that names its own, or of a plain type."""
    if isinstance(kind, type) and hasattr(kind, "core_schema"):
        return kind.core_schema()
    if kind in _PLAIN:
        return _PLAIN[kind]
    parts = get_args(kind)
    match get_origin(kind):
        case origin if origin is Annotated:
            *of, last = parts
            return last.schema(Annotated[tuple(of)] if len(of) > 1 else of[0])
        case origin if origin is Literal:
            return core_schema.literal_schema(list(parts))
        case origin if origin in (Union, UnionType):
            chosen = [schema_of(part) for part in parts if part is not NoneType]
            some = chosen[0] if len(chosen) == 1 else core_schema.union_schema([*chosen])
            return core_schema.nullable_schema(some) if NoneType in parts else some
        case origin if origin is tuple:
            if parts[-1] is ...:
                return core_schema.tuple_variable_schema(schema_of(parts[0]), strict=False)
            return core_schema.tuple_positional_schema([schema_of(part) for part in parts], strict=False)
        case origin if origin is dict:
            return core_schema.dict_schema(*map(schema_of, parts))
    raise TypeError(f"{kind} is nothing that a field may hold")


def marks(kind: Any) -> Iterator[Any]:
    """Every mark in an annotation, from the inside out."""
    for part in get_args(kind):
        yield from marks(part)
    yield from getattr(kind, "__metadata__", ())


_PLAIN: dict[Any, CoreSchema] = {
    bool: core_schema.bool_schema(),
    str: core_schema.str_schema(),
    Any: core_schema.any_schema(),
}


class Within(Value):
    """A number: finite, in its range, never read from text."""

    ge: float | None = None
    le: float | None = LARGEST
    gt: float | None = None
    lt: float | None = None

    def schema(self, of: Any = float) -> CoreSchema:
        return core_schema.float_schema(
            strict=True, allow_inf_nan=False, ge=self.ge, gt=self.gt, le=self.le, lt=self.lt
        )


class Whole(Value):
    """A whole number in its range."""

    ge: int
    le: int | None = None

    def schema(self, of: Any = int) -> CoreSchema:
        return core_schema.int_schema(strict=True, ge=self.ge, le=self.le)


class Text(Value):
    """Text of a form, or up to a length."""

    pattern: str | None = None
    longest: int | None = None

    def schema(self, of: Any = str) -> CoreSchema:
        return core_schema.str_schema(pattern=self.pattern, max_length=self.longest)


class Many(Value):
    """A list of at least and at most so many parts."""

    least: int
    most: int | None = None

    def schema(self, of: Any) -> CoreSchema:
        part, _ = get_args(of)
        return core_schema.tuple_variable_schema(
            schema_of(part), min_length=self.least, max_length=self.most, strict=False
        )


class Three(Value):
    """Three numbers in a list; other ways to write them are made such a list by `written`, a function."""

    each: Within
    written: Callable[[Any], Any] | None = None

    def schema(self, of: Any) -> CoreSchema:
        listed = core_schema.tuple_positional_schema([self.each.schema()] * 3, strict=False)
        if self.written is None:
            return listed
        return core_schema.no_info_before_validator_function(self.written, listed)


def spread(value: Any) -> Any:
    """One number as three equal ones; anything else unchanged."""
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


HEX = "^#([0-9A-Fa-f]{3}|[0-9A-Fa-f]{6})$"
"""A colour as style sheets write it; of three digits each stands for two equal ones."""


def color(value: Any) -> Any:
    """The three linear numbers of a colour: from one number, three numbers or text like `#ff8800`, in sRGB.

    Raises
    ------
    PydanticCustomError
        Of type `color`, for anything else.
    """
    if isinstance(value, str) and re.fullmatch(HEX, value):
        digits = value[1:] if len(value) == 7 else "".join(2 * digit for digit in value[1:])
        return tuple(_linear(int(digits[k : k + 2], 16) / 255) for k in (0, 2, 4))
    listed = spread(value)
    if not isinstance(listed, list | tuple) or len(listed) != 3:
        raise PydanticCustomError("color", "no colour")
    return listed


def _linear(code: float) -> float:
    """Linear light of an sRGB value, as `pixels.from_srgb` without numpy."""
    return code / 12.92 if code <= 0.04045 else float(((code + 0.055) / 1.055) ** 2.4)


class Before(Value):
    """A short form is written out, by a function, before what it stands for is looked at."""

    function: Callable[[Any], Any]
    written: Any = None
    """What a scene may write, an annotation; by default what it stands for alone."""

    def schema(self, of: Any) -> CoreSchema:
        short = None if self.written is None else schema_of(self.written)
        return core_schema.no_info_before_validator_function(
            self.function, schema_of(of), json_schema_input_schema=short
        )


class After(Value):
    """A function has the last word: it returns the value, or raises ValueError."""

    function: Callable[[Any], Any]
    form: str | None = None
    """A pattern that says about the same of a text."""

    def schema(self, of: Any) -> CoreSchema:
        return core_schema.no_info_after_validator_function(
            self.function, schema_of(of), metadata={"form": self.form}
        )


class Tag(Value):
    """Names one choice of a union that is told apart by `By`."""

    tag: str

    def schema(self, of: Any) -> CoreSchema:
        return schema_of(of)


class By(Value):
    """Tells the choices of a union apart: by a key that each has with its own value, or by a function."""

    key: str | Callable[[Any], str | None]
    unknown: str | None = None
    """What is wrong where no choice has the value's tag."""

    def schema(self, of: Any) -> CoreSchema:
        return core_schema.tagged_union_schema(
            {self._tag(part): schema_of(part) for part in get_args(of)},
            self.key,
            custom_error_type=self.unknown and "choice_unknown",
            custom_error_message=self.unknown,
        )

    def _tag(self, part: Any) -> str:
        if isinstance(self.key, str):
            return str(get_args(part.fields()[self.key].kind)[0])
        return next(mark.tag for mark in part.__metadata__ if isinstance(mark, Tag))


def nonzero(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """The vector itself; the last word on directions, which a zero vector is not."""
    if not any(vector):
        raise ValueError("must not be the zero vector")
    return vector


Number: TypeAlias = Annotated[float, Within(ge=-LARGEST)]
NonNegative: TypeAlias = Annotated[float, Within(ge=0)]
Positive: TypeAlias = Annotated[float, Within(gt=0)]
Share: TypeAlias = Annotated[float, Within(ge=0, le=1)]

Vector: TypeAlias = Annotated[tuple[float, float, float], Three(Within(ge=-LARGEST))]
Direction: TypeAlias = Annotated[Vector, After(nonzero)]
Color: TypeAlias = Annotated[tuple[float, float, float], Three(Within(ge=0), color)]
Albedo: TypeAlias = Annotated[tuple[float, float, float], Three(Within(ge=0, le=1), color)]
Name: TypeAlias = Annotated[str, Text(r"^[A-Za-z_][\w-]*$")]
