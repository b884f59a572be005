"""What every description in a scene file is made of: frozen models and strict numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Self, TypeAlias

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import CoreSchema, core_schema

LARGEST = 1e18  # squares and products of three such numbers stay finite in float32's exponent range


class Description(BaseModel):
    """A frozen part of a scene; unknown keys are refused, text is never read as a number."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, validate_default=False, defer_build=True
    )

    @model_validator(mode="wrap")
    @classmethod
    def _noted(cls, value: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo) -> Self:
        """Note in the context, if there is one, which class refused `value`: messages name its keys."""
        try:
            return handler(value)
        except ValidationError:
            if info.context is not None:
                info.context[id(value)] = cls
            raise


def spread(value: Any) -> Any:
    """One number as three equal ones; anything else unchanged."""
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def nonzero(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """The vector itself; a validator for directions, which a zero vector is not."""
    if not any(vector):
        raise ValueError("must not be the zero vector")
    return vector


@dataclass(frozen=True, slots=True)
class Within:
    """Annotation of a number: finite, in its range, never read from text.

    It names pydantic's own schema: to derive that from `Field(ge=...)` takes half of start-up.
    """

    ge: float | None = None
    le: float = LARGEST
    gt: float | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.float_schema(strict=True, allow_inf_nan=False, ge=self.ge, gt=self.gt, le=self.le)


@dataclass(frozen=True, slots=True)
class Three:
    """Annotation of three numbers in a list; where `spread`, one number stands for three equal ones."""

    each: Within
    spread: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        numbers = [self.each.__get_pydantic_core_schema__(float, handler)] * 3
        listed = core_schema.tuple_schema(numbers, strict=False)
        return core_schema.no_info_before_validator_function(spread, listed) if self.spread else listed


Number: TypeAlias = Annotated[float, Within(ge=-LARGEST)]
NonNegative: TypeAlias = Annotated[float, Within(ge=0)]
Positive: TypeAlias = Annotated[float, Within(gt=0)]
Share: TypeAlias = Annotated[float, Within(ge=0, le=1)]

Vector: TypeAlias = Annotated[tuple[float, float, float], Three(Within(ge=-LARGEST))]
Color: TypeAlias = Annotated[tuple[float, float, float], Three(Within(ge=0), spread=True)]
Albedo: TypeAlias = Annotated[tuple[float, float, float], Three(Within(ge=0, le=1), spread=True)]
