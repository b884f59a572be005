"""The inputs of a case, converted for the renderer's functions: arrays of length 1, in a chosen precision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from illumcli.arrays import Floats, Vectors, column_major
from illumcli.errors import InputError
from illumcli.records import Value
from illumcli.schema.messages import suggestion

T = TypeVar("T")


class Inputs(Value):
    """The inputs of a case by key; missing or malformed ones raise an InputError at `place`.

    `dtype` is the precision of all returned arrays. The inputs in `rounded` are rounded to float32 first, so
    that float64 code can be run with the inputs of float32 code.
    """

    place: str
    id: str
    values: Mapping[str, Any]
    dtype: DTypeLike = np.float64
    rounded: frozenset[str] = frozenset()

    def value(self, key: str) -> Any:
        """The input as in the file."""
        if key not in self.values:
            raise InputError(f"{self.place}: inputs lack '{key}'")
        return self.values[key]

    def number(self, key: str) -> float:
        """A scalar, for parameters of models."""
        return float(self._array(key, ()))

    def number_or_none(self, key: str) -> float | None:
        """A scalar, or None if the file has null."""
        return None if self.value(key) is None else self.number(key)

    def scalars(self, key: str) -> Floats:
        """(1,) a scalar as an array."""
        return self._array(key, ()).reshape(1)

    def color(self, key: str) -> tuple[float, float, float]:
        """Three numbers; a single number is repeated."""
        value = np.broadcast_to(self._array(key, (), (3,)), 3)
        return float(value[0]), float(value[1]), float(value[2])

    def vectors(self, key: str) -> Vectors:
        """(k, 3) points or vectors, not normalized; a single one is (1, 3)."""
        return column_major(self._array(key, (3,), (None, 3)).reshape(-1, 3))

    def points2(self, key: str) -> NDArray[Any]:
        """(2,) the first two components of a point."""
        return self._array(key, (2,), (3,))[:2]

    def unit(self, key: str) -> Vectors:
        """(1, 3) direction, normalized in float64 before it is rounded."""
        vector = self._exact(key, (3,))
        size = np.linalg.norm(vector)
        if not size > 0:
            raise InputError(f"{self.place}: inputs '{key}' must not be the zero vector")
        return column_major(self._round(key, vector / size).reshape(1, 3))

    def tangent(self) -> Vectors:
        """(1, 3) unit: the direction `t`, projected perpendicular to `n` in float64 before it is rounded."""
        n, t = self._exact("n", (3,)), self._exact("t", (3,))
        t = t - (t @ n) / (n @ n) * n
        return column_major(self._round("t", t / np.linalg.norm(t)).reshape(1, 3))

    def between(self, start: str, end: str) -> Vectors:
        """(1, 3) unit direction from one point to another, in float64 before it is rounded."""
        vector = self._exact(end, (3,)) - self._exact(start, (3,))
        key = start if start in self.rounded else end
        return column_major(self._round(key, vector / np.linalg.norm(vector)).reshape(1, 3))

    def part(self, key: str) -> Inputs:
        """The inputs inside an object."""
        return self._inside(key, self.value(key))

    def parts(self, key: str) -> list[Inputs]:
        """The inputs inside each object of a list."""
        value = self.value(key)
        if not isinstance(value, list):
            raise InputError(f"{self.place}: inputs '{key}' must be a list")
        return [self._inside(key, each) for each in value]

    def choose(self, key: str, table: Mapping[str, T]) -> T:
        """The entry of `table` that the input names."""
        word = str(self.value(key))
        if word not in table:
            raise InputError(f"{self.place}: no {key} '{word}'; {suggestion(word, tuple(table))}")
        return table[word]

    def _inside(self, key: str, value: Any) -> Inputs:
        if not isinstance(value, dict):
            raise InputError(f"{self.place}: inputs '{key}' must be an object")
        return replace(self, values=value, rounded=frozenset(value if key in self.rounded else ()))

    def _exact(self, key: str, *shapes: tuple[int | None, ...]) -> NDArray[np.float64]:
        """The input in float64, which must have one of these shapes; None allows any length."""
        try:
            array = np.asarray(self.value(key))
        except ValueError:
            array = np.empty(0, object)
        fits = any(
            array.ndim == len(shape)
            and all(want in (None, have) for want, have in zip(shape, array.shape, strict=True))
            for shape in shapes
        )
        if array.dtype.kind not in "if" or not fits:
            wanted = " or ".join("a number" if shape == () else f"{shape[-1]} numbers" for shape in shapes)
            raise InputError(f"{self.place}: inputs '{key}' must be {wanted}, is {self.value(key)!r}")
        return array.astype(np.float64)

    def _round(self, key: str, array: NDArray[np.float64]) -> NDArray[Any]:
        return (array.astype(np.float32) if key in self.rounded else array).astype(self.dtype)

    def _array(self, key: str, *shapes: tuple[int | None, ...]) -> NDArray[Any]:
        return self._round(key, self._exact(key, *shapes))
