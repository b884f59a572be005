"""The parameters of a model that a fit may change, as one vector of numbers.

A fit moves in coordinates in which equal steps mean about the same everywhere: the logarithm of a width or an
index whose range spans decades, log(1 + e) of an exponent, the number itself for shares and colours.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import Texture, VertexValues
from illumcli.records import Record, Value
from illumcli.schema.annotations import field_annotation, number_range
from illumcli.schema.description import Description, owner_of
from illumcli.schema.families import tag_of

Doubles = NDArray[np.float64]
NOT_FITTED = ("emission", "ambient")
"""Parameters that no measurement of a BRDF shows."""
DECADES = 2
"""A positive range of more decades is fitted by its logarithm."""
LARGEST_EXPONENT = 1e5
"""Of the search: a lobe a quarter of a degree wide."""
SEARCH = 20.0
"""How far from its default a parameter without close limits is sought, as a factor."""


class Parameter(Value):
    """A number or a colour of a model."""

    path: str
    """Where it is in the model: `diffuse`, or `distribution.m`."""
    width: int
    """3 for a colour, 1 for a number."""
    low: float
    high: float
    default: tuple[float, ...]
    scale: Literal["linear", "log", "log1p"]
    """The coordinate in which it is fitted."""

    def labels(self) -> list[str]:
        """Its name, or those of a colour's three numbers."""
        return [f"{self.path}.{channel}" for channel in "RGB"] if self.width == 3 else [self.path]

    def coordinate(self, value: Any) -> Doubles:
        """Values as coordinates."""
        values = np.asarray(value, np.float64)
        if self.scale == "linear":
            return values
        return np.log(values) if self.scale == "log" else np.log1p(values)

    def value(self, coordinate: Any) -> Doubles:
        """Coordinates as values, within the range."""
        x = np.asarray(coordinate, np.float64)
        values = x if self.scale == "linear" else np.exp(x) if self.scale == "log" else np.expm1(x)
        return np.clip(values, self.low, self.high)

    def slope(self, coordinate: Any) -> Doubles:
        """The derivative of the value by its coordinate."""
        x = np.asarray(coordinate, np.float64)
        return np.ones_like(x) if self.scale == "linear" else np.exp(x)

    def searched(self) -> tuple[float, float]:
        """The coordinates among which starts are chosen."""
        low, high = self.low, self.high
        if self.scale == "log":
            low, high = max(low, min(self.default) / SEARCH), min(high, max(self.default) * SEARCH)
        elif self.scale == "log1p":
            high = min(high, LARGEST_EXPONENT)
        elif high > 1e3:
            high = min(high, max(1.0, *self.default) * SEARCH)
        return float(self.coordinate(low)), float(self.coordinate(high))


class Parameters(Record):
    """Free parameters, and those that are kept equal to one of them."""

    free: tuple[Parameter, ...]
    equal: Mapping[str, str]
    """Path -> path of the free parameter that it equals."""

    @property
    def count(self) -> int:
        """The number of coordinates."""
        return sum(each.width for each in self.free)

    def slices(self) -> Iterator[tuple[Parameter, slice]]:
        """The free parameters, with the places of their coordinates."""
        first = 0
        for each in self.free:
            yield each, slice(first, first + each.width)
            first += each.width

    def labels(self) -> list[str]:
        """A name for each coordinate."""
        return [label for each in self.free for label in each.labels()]

    def limits(self) -> tuple[Doubles, Doubles]:
        """The lowest and the highest coordinates."""
        low = [each.coordinate(each.low) for each in self.free for _ in range(each.width)]
        high = [each.coordinate(each.high) for each in self.free for _ in range(each.width)]
        return np.array(low, np.float64), np.array(high, np.float64)

    def searched(self) -> tuple[Doubles, Doubles]:
        """The limits of the coordinates among which starts are chosen."""
        limits = [each.searched() for each in self.free for _ in range(each.width)]
        low, high = np.array(limits, np.float64).reshape(-1, 2).T
        return low, high

    def values(self, coordinates: Doubles) -> dict[str, Any]:
        """Path -> number or colour, also of the parameters that are kept equal."""
        of_path: dict[str, Any] = {}
        for each, place in self.slices():
            numbers = tuple(each.value(coordinates[place]).tolist())
            of_path[each.path] = numbers if each.width == 3 else numbers[0]
        return of_path | {path: of_path[source] for path, source in self.equal.items()}

    def coordinates(self, model: IlluminationModel) -> Doubles:
        """The coordinates of a model's values."""
        parts = [np.atleast_1d(each.coordinate(value_at(model, each.path))) for each in self.free]
        return np.concatenate(parts) if parts else np.zeros(0)


def parameters_of(model: IlluminationModel, is_isotropic: bool) -> Parameters:
    """The parameters of a model that were not given, so that a fit is free to change them.

    Parameters
    ----------
    model : IlluminationModel
        As described: its given parameters are kept.
    is_isotropic : bool
        Keep parameters equal that only differ where a surface has a grain.

    Raises
    ------
    InputError
        No parameter can be fitted.
    """
    free = list(_free(model))
    equal = _without_grain(model, free) if is_isotropic else {}
    kept = tuple(each for each in free if each.path not in equal)
    if not kept:
        raise InputError(
            f"{tag_of(type(model))}: has no parameter to fit; leave numbers out of -D, or choose a model "
            "with numeric parameters, see illum models"
        )
    return Parameters(kept, equal)


def value_at(model: IlluminationModel, path: str) -> Any:
    """The value of a parameter by its path."""
    return getattr(*owner_of(model, path))


def _free(part: Description, prefix: str = "") -> Iterator[Parameter]:
    for name in type(part).model_fields:
        value, path = getattr(part, name), prefix + name
        if path in NOT_FITTED:
            continue
        if isinstance(value, Texture | VertexValues):
            raise InputError(f"-D {path}: varies over the surface; a fit is of one point: give a number")
        if isinstance(value, Description):
            yield from _free(value, f"{path}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], Description):
            for place, each in enumerate(value):
                yield from _free(each, f"{path}.{place}.")
        elif name not in part.model_fields_set and value is not None:
            try:
                limits = number_range(field_annotation(type(part), name))
            except LookupError:
                continue
            low = limits.ge if limits.ge is not None else limits.gt
            high = limits.le if limits.le is not None else limits.lt
            if low is not None and high is not None:
                default = value if isinstance(value, tuple) else (value,)
                yield Parameter(path, limits.width, low, high, default, _scale(low, high, limits.width))


def _scale(low: float, high: float, width: int) -> Literal["linear", "log", "log1p"]:
    if low > 0 and high / low >= 10.0**DECADES:
        return "log"
    return "log1p" if low == 0 and high > 1e3 and width == 1 else "linear"


def _without_grain(model: IlluminationModel, free: Sequence[Parameter]) -> dict[str, str]:
    """Pairs of free numbers that, if equal, leave the model without grain: second -> first.

    Where the model has parts of one kind, the same pair of each of them.
    """
    if not model.has_grain():
        return {}
    numbers = [each for each in free if each.width == 1]
    for place, first in enumerate(numbers):
        for second in numbers[place + 1 :]:
            names = [path.rpartition(".")[2] for path in (first.path, second.path)]
            equal = {
                other.path: each.path
                for each in numbers
                for other in numbers
                if [each.path, other.path] == [_beside(each.path, name) for name in names]
            }
            if (first.low, first.high) == (second.low, second.high) and second.path in equal:
                values = {path: value_at(model, source) for path, source in equal.items()}
                if not model.at(values).has_grain():
                    return equal
    return {}


def _beside(path: str, name: str) -> str:
    """The path of a parameter in the same part as another."""
    above, dot, _ = path.rpartition(".")
    return above + dot + name
