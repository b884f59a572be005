"""Random parameters of illumination models, within their ranges."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, TypeVar

import numpy as np

from illumcli.models._base import IlluminationModel
from illumcli.schema.annotations import annotation_at, field_annotation, number_range
from illumcli.schema.description import Description

WIDEST = 10.0
"""Most drawn values are within this above the least."""
SHARP = (1e-3, 0.999, 1e3, 1e6)
"""Values at which formulas tend to break."""
TRIES = 20
D = TypeVar("D", bound=Description)


def drawn(model: IlluminationModel, random: np.random.Generator) -> IlluminationModel:
    """The model with random numbers and colours; each choice (a word, a flag, an optional part) is kept."""
    for _ in range(TRIES):
        with suppress(ValueError):  # numbers that exclude each other
            return type(model).model_validate(_drawn(model, random))
    return model


def _drawn(part: Description, random: np.random.Generator) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in part:
        if isinstance(value, Description):
            values[name] = _drawn(value, random)
        elif isinstance(value, float | tuple) and name not in ("emission", "ambient"):
            values[name] = _value(field_annotation(type(part), name), value, random)
        else:
            values[name] = value
    return values


def _value(annotation: Any, value: Any, random: np.random.Generator) -> Any:
    """A random value of a field that holds a number or a colour; other lists are kept."""
    try:
        within = number_range(annotation)
    except LookupError:
        return value
    low = within.ge if within.gt is None else within.gt
    high = within.le if within.lt is None else within.lt
    low, high = max(-WIDEST if low is None else low, -WIDEST), 1.0 if high is None else high
    ends = [high * (1 - 1e-9) if within.lt is not None else high]
    ends += [low] if within.gt is None else []
    sharp = [each for each in SHARP if low < each < high]

    def number() -> float:
        kind = random.integers(4)
        if kind == 0:
            return float(random.choice([*sharp, *ends]))
        return float(low + (min(high, WIDEST + low) - low) * (1 - random.random()))

    return number() if within.width == 1 else (number(), number(), number())


def with_values(model: IlluminationModel, random: np.random.Generator) -> IlluminationModel:
    """The model with a random value in place of each texture or vertex attribute."""
    values = {}
    for path in model.varying():
        within = number_range(annotation_at(model, path))
        low, high = max(within.ge or within.gt or 0.0, 0.0), within.le or 1.0
        drawn = low + (min(high, low + 1) - low) * random.random(within.width)
        values[path] = tuple(drawn.tolist()) if within.width == 3 else float(drawn[0])
    return model.at(values) if values else model
