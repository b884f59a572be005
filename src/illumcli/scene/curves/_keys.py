"""Interpolation between keys: positions on an axis, each with the value there."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from illumcli.keyframes import Interpolation, interpolate
from illumcli.scene.curves._base import rounded
from illumcli.schema.fields import color
from illumcli.schema.messages import describe, short


def key_numbers(keys: Mapping[str, Any]) -> list[tuple[float, str]]:
    """Position and text of each key, in the order of positions.

    Raises
    ------
    ValueError
        A key is no number, or two are the same one.
    """
    numbers = sorted((_number(text), text) for text in keys)
    for (a, first), (b, second) in pairwise(numbers):
        if a == b:
            raise ValueError(f"the keys {first} and {second} are the same; remove one")
    return numbers


def _number(text: str) -> float:
    number = number_in(text)
    if number is None:
        raise ValueError(f"the key '{short(text)}' is no number; write keys as {{0: VALUE, 24: VALUE}}")
    return float(number)


def number_in(text: str) -> int | float | None:
    """The finite number that a text is; None if it is none."""
    if re.fullmatch(r"[-+]?\d{1,18}", text, re.ASCII):
        return int(text)
    is_number = re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", text, re.ASCII)
    number = float(text) if is_number else math.inf
    return number if math.isfinite(number) else None


def numeric(value: Any) -> Any:
    """A value to interpolate: a number, or a list of such; a colour as text becomes its three linear numbers.

    Raises
    ------
    ValueError
        It has no values between it and another.
    """
    if isinstance(value, list | tuple):
        return [numeric(part) for part in value]
    if isinstance(value, str) and value.startswith("#"):
        return list(color(value))
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"must be numbers, is {describe(value)}; what is no number has curve: step")
    return float(value)


def same_shape(values: Sequence[Any]) -> list[Any]:
    """Values of equal lengths; one number is repeated to the length of the others.

    Raises
    ------
    ValueError
        The lengths differ.
    """
    lists = [value for value in values if isinstance(value, list)]
    if not lists:
        return list(values)
    lengths = {len(value) for value in lists}
    if len(lengths) > 1:
        raise ValueError(f"have {' and '.join(map(str, sorted(lengths)))} numbers; give all keys as many")
    (length,) = lengths
    spread = [value if isinstance(value, list) else [value] * length for value in values]
    columns = [same_shape(column) for column in zip(*spread, strict=True)]
    return [list(row) for row in zip(*columns, strict=True)]


def between(at: float, positions: Sequence[float], values: Sequence[Any], how: Interpolation) -> Any:
    """The value at `at`: of the first key before it, of the last one after it, and between in this way.

    Parameters
    ----------
    positions : sequence of float
        Increasing.
    values : sequence
        As of `same_shape`; of any kind for `step`.
    """
    index = bisect_right(positions, at) - 1
    if how == "step" or index < 0 or index == len(positions) - 1:
        return _rounded(values[max(index, 0)])
    table = np.asarray(values, np.float64)
    row = interpolate([at], positions, table.reshape(len(table), -1), how)
    return _rounded(row.reshape(table.shape[1:]).tolist())


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return rounded(value) if isinstance(value, float) else value


def keys_over_surface(
    positions: Sequence[float], values: Sequence[Any], how: Interpolation
) -> dict[str, Any]:
    """Keys in the form of `models._parameters.Keys`.

    Raises
    ------
    ValueError
        The values are neither numbers nor colours.
    """
    fact = "must have numbers or colours as keys, to vary over the surface by maps"
    try:
        table = same_shape([numeric(value) for value in values])
    except ValueError:
        raise ValueError(fact) from None
    rows = [value if isinstance(value, list) else [value] for value in table]
    if any(len(row) not in (1, 3) or any(isinstance(part, list) for part in row) for row in rows):
        raise ValueError(fact)
    return {"positions": [rounded(each) for each in positions], "values": rows, "interpolation": how}
