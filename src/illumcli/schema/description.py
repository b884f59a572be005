"""Base of all parts of a scene: frozen pydantic models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict


def default_of(keys: Mapping[str, Any]) -> Any:
    """The default of a field that holds a description, as a scene would write it."""
    return dict(keys)


DEFAULTS: Any = default_of({})
"""Default of a field that holds a description with all its defaults."""


class Description(BaseModel):
    """A part of a scene. Unknown keys are refused, text is never read as a number, numbers are finite.

    The validators of a class are built when a scene first uses it: a run builds those that its scene names.
    """

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        validate_default=True,
        defer_build=True,
    )


def parts_of(part: Description | Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """The values of a description, or of a mapping of values by name."""
    return part.items() if isinstance(part, Mapping) else part


def nested(value: Any) -> dict[str, Description | Mapping[str, Any]]:
    """The descriptions in the value of a field, by the rest of their path: itself, or those of a list; or a
    mapping of values by name."""
    if isinstance(value, Description | Mapping):
        return {"": value}
    if isinstance(value, tuple):
        return {f".{i}": part for i, part in enumerate(value) if isinstance(part, Description)}
    return {}


def owner_of(description: Description, path: str) -> tuple[Description, str]:
    """The part of a description that has the field at a path (`further.0.cx`), and the field's name."""
    *steps, name = path.split(".")
    owner: Any = description
    for step in steps:
        owner = owner[int(step)] if isinstance(owner, tuple) else getattr(owner, step)
    return owner, name


def as_json(value: Any) -> Any:
    """A value of a description as a scene writes it: descriptions without what they leave out."""
    if isinstance(value, Description):
        return value.model_dump(mode="json", exclude_unset=True)
    if isinstance(value, Mapping):
        return {name: as_json(part) for name, part in value.items()}
    return [as_json(part) for part in value] if isinstance(value, tuple | list) else value
