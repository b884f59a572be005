"""What every description in a scene file is made of: frozen models and strict numbers."""

from __future__ import annotations

from typing import Annotated, Any, Self, TypeAlias

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    model_validator,
)

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


Number: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
NonNegative: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST)]
Positive: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST)]
Share: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]

Vector: TypeAlias = Annotated[tuple[Number, Number, Number], Field(strict=False)]

# one number stands for three equal ones
Color: TypeAlias = Annotated[
    tuple[NonNegative, NonNegative, NonNegative], Field(strict=False), BeforeValidator(spread)
]
Albedo: TypeAlias = Annotated[tuple[Share, Share, Share], Field(strict=False), BeforeValidator(spread)]
