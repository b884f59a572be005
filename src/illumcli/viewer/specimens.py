"""Models that the BRDF panel shows: materials of the scene, of its objects, or models by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from illumcli.errors import InputError
from illumcli.images.drawings import read_numbers
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import CurveOverSurface, OverSurface
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.schema.annotations import annotation_at, number_range
from illumcli.schema.description import owner_of
from illumcli.schema.families import member
from illumcli.schema.messages import suggestion
from illumcli.viewer.edits import MODELS
from illumcli.viewer.switching import switched


def described(loaded: SceneFile, of: Mapping[str, Any]) -> IlluminationModel:
    """The model that the panel asks for.

    Parameters
    ----------
    of : mapping
        `{"material": name}`, `{"object": name}` or `{"model": tag}`.

    Raises
    ------
    InputError
        There is none.
    """
    scene = loaded.scene
    match of:
        case {"material": str(name)}:
            material: IlluminationModel = _named(scene.materials, "material", name)
            return material
        case {"object": str(name)}:
            thing = _named(dict(zip(scene.object_names(), scene.objects, strict=True)), "object", name)
            model = scene.material_of(thing) or scene.fallback_of(thing)
            if model is None:
                fact = f"object '{name}' has the materials of its mesh file"
                raise InputError(f"{fact}; choose a model by name")
            return model
        case {"model": str(tag)}:
            try:
                cls = member(MODELS, tag)
            except LookupError as error:
                raise InputError(f"no model '{tag}'; {error}") from None
            default: IlluminationModel = cls.model_validate(switched(None, cls, 1.0))
            return default
    raise InputError("a BRDF is that of a material, an object or a model; name one")


def _named(parts: Mapping[str, Any], kind: str, name: str) -> Any:
    if name not in parts:
        raise InputError(f"no {kind} '{name}'; {suggestion(name, tuple(parts))}")
    return parts[name]


def prepared(loaded: SceneFile, model: IlluminationModel) -> IlluminationModel:
    """A model ready to be evaluated, its files read, with constants for what varies over the surface.

    Raises
    ------
    InputError
        A file cannot be used.
    """
    constants = {path: _constant(model, path, value) for path, value in model.varying().items()}
    files = {path: str(resolve(loaded, file)) for path, file in model.files().items()}
    return model.at(constants | files).prepared(read_numbers)


def _constant(model: IlluminationModel, path: str, value: OverSurface) -> Any:
    """What a parameter is where its map is white; its default if a curve varies with the map, or a half."""
    limits = number_range(annotation_at(model, path))
    if isinstance(value, CurveOverSurface):
        owner, name = owner_of(model, path)
        field = type(owner).model_fields.get(name) if hasattr(type(owner), "model_fields") else None
        if field is not None and not field.is_required() and field.default is not None:
            return field.default
        numbers: tuple[float, ...] = (0.5, 0.5, 0.5)
    else:
        numbers = value.factor
    low, high = limits.ge or limits.gt or 0.0, limits.le or limits.lt or 1.0
    clipped = tuple(min(max(number, low), high) for number in numbers)
    return clipped if limits.width == 3 else clipped[0]
