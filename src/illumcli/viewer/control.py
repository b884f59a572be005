"""A control of the page: what kind it is and how far its slider goes, from the schema of a parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, Literal, NamedTuple, TypeAlias

from illumcli.records import Value
from illumcli.schema.fields import HEX

Kind: TypeAlias = Literal["number", "integer", "color", "vector", "choice", "switch", "text"]
Schema: TypeAlias = Mapping[str, Any]

DECADES = 2
"""A range of more decades has a logarithmic slider."""
FAR = 1e6
"""Limits beyond are no ends of a slider: those of numbers that have no limit but that of float32."""
REACH = 100.0
"""How far a slider without limits goes from the number in the scene, as a factor; the third root of it for
whole numbers, which are sizes and counts."""
SPREAD = 4.0
"""The same for numbers that may be negative or are 0, and for colours above 1."""
COUNT = 4096.0
"""End of the slider of a whole number that the scene leaves out."""
OPEN = 1e-3
"""Distance from a limit that a number may not have, as a share of the range."""


class Control(Value):
    """A control of the page."""

    path: str
    """Of the value in the scene, as for -D."""
    group: str
    label: str
    help: str
    kind: Kind
    value: Any
    """What is in force, as JSON; None where the parameter is left out; YAML for `text`."""
    default: Any
    """The value where the scene does not give one; None if it must."""
    original: Any
    """The value in the scene file; None if it has none."""
    minimum: float | None = None
    """Lower end of the slider; the description may allow less."""
    maximum: float | None = None
    logarithmic: bool = False
    choices: tuple[str, ...] = ()
    unit: str = ""
    changed: bool = False
    """True if the value is not that of the scene file, or of the default where the file has none."""
    optional: bool = False
    """True if the parameter may be left out."""

    def as_data(self) -> dict[str, Any]:
        """The control for JSON."""
        return {each.name: getattr(self, each.name) for each in fields(self)}


class Shape(NamedTuple):
    """What a parameter's schema says of the values it takes."""

    kind: Kind
    number: Schema
    """Schema of the number, or of each number; empty for other kinds."""
    choices: tuple[str, ...]
    optional: bool


class Slider(NamedTuple):
    """The ends of a slider."""

    minimum: float
    maximum: float
    logarithmic: bool


def shape_of(part: Schema) -> Shape:
    """The kind of control for a parameter with this schema; `text` where nothing else suits."""
    plain, optional = without_null(part)
    plain = plain.get("oneOf", [plain])[0]  # a constant; others are maps, or text for a distance
    if "enum" in plain and all(isinstance(each, str) for each in plain["enum"]):
        return Shape("choice", {}, tuple(plain["enum"]), optional)
    match plain.get("type"):
        case "number":
            return Shape("number", plain, (), optional)
        case "integer":
            return Shape("integer", plain, (), optional)
        case "boolean":
            return Shape("switch", {}, (), optional)
    forms = plain.get("anyOf", [plain])
    items = forms[-1].get("items", {})
    has_length = "maxItems" in forms[-1]
    if items.get("type") != "number" or not has_length:
        return Shape("text", {}, (), optional)
    is_color = any(form.get("pattern") == HEX for form in forms)
    return Shape("color" if is_color else "vector", items, (), optional)


def without_null(part: Schema) -> tuple[Schema, bool]:
    """A schema without `null`, and whether it had it."""
    forms = [form for form in part.get("anyOf", ()) if form.get("type") != "null"]
    if len(forms) == len(part.get("anyOf", ())):
        return part, False
    return (forms[0] if len(forms) == 1 else {"anyOf": forms}), True


def slider_of(shape: Shape, values: Sequence[Any]) -> Slider | None:
    """The slider of a parameter; None if it has no numbers.

    Parameters
    ----------
    values : sequence
        Those that it must reach: first what the scene has, or else the default; None for none.
    """
    if not shape.number:
        return None
    reached = [number for value in values for number in _numbers(value)]
    usual = next((max(map(abs, _numbers(value))) for value in values if any(_numbers(value))), 0.0)
    low, high = _limit(shape.number, "minimum"), _limit(shape.number, "maximum")
    logarithmic = low is not None and high is not None and low > 0 and high / low >= 10**DECADES
    if high is None:
        logarithmic = low is not None and (usual > 0 or low > 0) and shape.kind in ("number", "integer")
        if shape.kind == "integer" and usual == 0:
            high = COUNT
        elif logarithmic:
            reach = REACH if shape.kind == "number" else REACH ** (1 / 3)
            low, high = max(low or 0, usual / reach), usual * reach
        elif shape.kind == "color":
            high = SPREAD * usual if usual > 1 else 1.0
        else:
            high = SPREAD * (usual or 1.0)
    low = -high if low is None else low

    # Limits that a number may not have are approached only.
    gap = OPEN * (high - low)
    if not logarithmic:
        low = low + gap if low == shape.number.get("exclusiveMinimum") else low
    high = high - gap if high == shape.number.get("exclusiveMaximum") else high

    within = [number for number in reached if number > 0 or not logarithmic]
    low, high = min([low, *within]), max([high, *within])
    if shape.kind == "integer":
        low, high = float(round(low)), float(round(high))
    return Slider(low, high, logarithmic)


def _numbers(value: Any) -> Iterator[float]:
    """The numbers of a value."""
    if isinstance(value, list | tuple):
        for each in value:
            yield from _numbers(each)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)


def _limit(number: Schema, name: str) -> float | None:
    """A limit of a number that is an end of a slider; None if it is too far away."""
    limit = number.get(name, number.get(f"exclusive{name.capitalize()}"))
    return None if limit is None or abs(limit) > FAR else float(limit)
