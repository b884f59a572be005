"""Models with several specular lobes: those whose description has a list of further ones."""

from __future__ import annotations

from typing import get_args, get_origin

from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel
from illumcli.schema.annotations import field_annotation, split
from illumcli.schema.description import Description
from illumcli.schema.families import members, tag_of


def with_lobes(model: IlluminationModel, count: int) -> IlluminationModel:
    """The model with so many lobes in all, the further ones at their defaults.

    Raises
    ------
    InputError
        The model has one lobe. A scene cannot express the sum of two materials, so none is fitted.
    """
    if count == 1:
        return model
    found = _list_of_lobes(type(model))
    if found is None:
        able = [tag_of(each) for each in members("illumcli.models") if _list_of_lobes(each)]
        raise InputError(
            f"{tag_of(type(model))}: has one specular lobe, and a scene has no sum of materials to "
            f"show {count}; models with several: {', '.join(able) or 'none'}"
        )
    name, Lobe = found
    given = getattr(model, name)
    further = (*given, *(Lobe() for _ in range(count - 1 - len(given))))
    return model.model_copy(update={name: further})


def _list_of_lobes(Model: type[Description]) -> tuple[str, type[Description]] | None:
    """The field of a model that lists descriptions, and their class."""
    for name in Model.model_fields:
        plain, _ = split(field_annotation(Model, name))
        parts = get_args(plain)
        is_list = get_origin(plain) is tuple and parts[-1] is ... and isinstance(parts[0], type)
        if is_list and issubclass(parts[0], Description):
            return name, parts[0]
    return None
