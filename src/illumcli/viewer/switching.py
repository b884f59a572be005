"""Another description in the place of one: another model, light, falloff or distance law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from illumcli.commands.schema_generator import schema_of_field
from illumcli.errors import InputError
from illumcli.lights._base import Light
from illumcli.models._base import IlluminationModel
from illumcli.schema.annotations import is_tag
from illumcli.schema.description import Description, as_json
from illumcli.schema.docs import unit_in
from illumcli.viewer.choices import tag_value
from illumcli.viewer.control import shape_of


def switched(old: Description | None, cls: type[Description], reach: float) -> dict[str, Any]:
    """The keys of a `cls` in the place of `old`: its values of what both have, and of what means the same, as
    far as `cls` takes them. Required keys that are missing get a usual value.

    Parameters
    ----------
    old : Description or None
        None if nothing stood there.
    reach : float
        A distance that is long in the scene [scene units].

    Raises
    ------
    InputError
        A required key has no usual value, such as the name of a file.
    """
    tag = tag_value(cls)
    kept = {} if old is None else _kept(old, cls)
    required = [name for name, field in cls.model_fields.items() if field.is_required() and name not in tag]
    for _ in range(2):
        usual = {name: _usual(cls, name, reach) for name in required if name not in kept}
        try:
            cls.model_validate(tag | kept | usual)
        except ValidationError as error:
            refused = {str(each["loc"][0]) if each["loc"] else "" for each in error.errors()}
            kept = {} if "" in refused else {name: kept[name] for name in kept if name not in refused}
        else:
            break
    return tag | kept | usual


def _kept(old: Description, cls: type[Description]) -> dict[str, Any]:
    """The values of `old` that the new class may take, without those that are its defaults."""
    kept: dict[str, Any] = {}
    before, after = _meanings(type(old)), _meanings(cls)
    renamed = {after[each]: before[each] for each in after.keys() & before.keys()}
    for name in cls.model_fields:
        source = renamed.get(name, name)
        if source not in type(old).model_fields or is_tag(cls, name):
            continue
        value = as_json(getattr(old, source))
        if value is not None and value != schema_of_field(cls, name).get("default"):
            kept[name] = value
    return kept


def _meanings(cls: type[Description]) -> Mapping[str, str]:
    """What fields of different names may both be -> the field of a class."""
    if issubclass(cls, IlluminationModel) and cls.surface_color in cls.model_fields:
        return {"color of the surface": cls.surface_color}
    return {"color of the light": cls.emission_field} if issubclass(cls, Light) else {}


def _usual(cls: type[Description], name: str, reach: float) -> Any:
    """A value for a required field: no distance or a long one, a place high up, a direction down."""
    schema = schema_of_field(cls, name)
    shape = shape_of(schema)
    if shape.kind == "vector":
        is_place = unit_in(schema.get("description", ""))
        return [0.0, reach, 0.0] if is_place else [0.0, -1.0, 0.0]
    if shape.kind == "number":
        return 0.0 if shape.number.get("minimum") == 0 else min(reach, shape.number["maximum"])
    what = " ".join(tag_value(cls).values())
    raise InputError(f"{what} needs {name}, which only its author knows; write it into the scene file")
