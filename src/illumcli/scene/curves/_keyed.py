"""Curves through key frames."""

from __future__ import annotations

from bisect import bisect_right
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import AfterValidator, Field, ValidationError

from illumcli.keyframes import Interpolation
from illumcli.scene.curves._base import Over, ReadFile
from illumcli.scene.curves._keys import between, key_numbers, keys_over_surface, numeric, same_shape
from illumcli.scene.curves._mapped import MappedCurve
from illumcli.scene.frames import Moment


def _at_numbers(keys: dict[str, Any]) -> dict[str, Any]:
    key_numbers(keys)
    return keys


Keys: TypeAlias = Annotated[
    dict[str, Any],
    Field(
        min_length=1, json_schema_extra={"propertyNames": {"pattern": r"^[-+]?[0-9.]+([eE][-+]?[0-9]+)?$"}}
    ),
    AfterValidator(_at_numbers),
]


def _interpolable(keys: dict[str, Any]) -> dict[str, Any]:
    """The keys themselves, if there are values between those that they have."""
    values = []
    for key, value in keys.items():
        try:
            values.append(numeric(value))
        except ValueError as error:
            raise ValidationError.from_exception_data(
                "keys", [{"type": "value_error", "loc": (key,), "input": value, "ctx": {"error": error}}]
            ) from None
    same_shape(values)
    return keys


NumberKeys: TypeAlias = Annotated[Keys, AfterValidator(_interpolable)]


class KeyedCurve(MappedCurve):
    """Values at some frames or times; the first holds before its key, the last after its own."""

    keys: Keys
    """The value at each frame or time, as the scene would have it."""
    over: Over = "frame"
    """What the keys are. `frame`: numbers of frames. `time`: seconds."""

    interpolation: ClassVar[Interpolation]

    def key_at(self, moment: Moment) -> str | None:
        """The key at this moment, the first before it or the last after it; for steps, the latest one."""
        if not self.is_plain():
            return None
        at, keys = getattr(moment, self.over), key_numbers(self.keys)
        position, text = keys[max(0, bisect_right([number for number, _ in keys], at) - 1)]
        is_outside = at <= keys[0][0] or at >= keys[-1][0]
        return text if is_outside or at == position or self.interpolation == "step" else None

    def axis(self, read: ReadFile) -> Over:
        return self.over

    def phi_at(self, moment: Moment, read: ReadFile) -> Any:
        keys = key_numbers(self.keys)
        if self.interpolation == "step":
            values = [self.keys[text] for _, text in keys]
        else:
            values = same_shape([numeric(self.keys[text]) for _, text in keys])
        at = getattr(moment, self.over)
        return between(at, [number for number, _ in keys], values, self.interpolation)

    def phi(self, moment: Moment, read: ReadFile) -> dict[str, Any]:
        keys = key_numbers(self.keys)
        values = [self.keys[text] for _, text in keys]
        return keys_over_surface([number for number, _ in keys], values, self.interpolation)
