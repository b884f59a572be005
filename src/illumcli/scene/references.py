"""Faults of names in a scene: names that do not exist, that are used twice or that exclude each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from illumcli.layers import owner_of
from illumcli.scene.faults import Fault, faults
from illumcli.scene.source import Path
from illumcli.schema.description import Description
from illumcli.schema.families import member
from illumcli.schema.foreign import BrokenMember
from illumcli.schema.messages import suggestion


def reference_faults(scene: Any) -> Iterator[Fault]:
    """All such faults with their paths.

    Parameters
    ----------
    scene
        A `Scene`, or its text as dicts and lists, which may have other faults: malformed parts are ignored.
    """
    yield from _camera_faults(scene)
    for i, thing in enumerate(_parts(_get(scene, "objects"))):
        for path, fact in _object_faults(scene, thing):
            yield ("objects", i, *path), fact
    for kind in ("objects", "lights"):
        yield from _name_faults(kind, _parts(_get(scene, kind)))


def _camera_faults(scene: Any) -> Iterator[Fault]:
    """Both camera and cameras, and names of objects that cameras fit."""
    if _get(scene, "camera") is not None and _get(scene, "cameras"):
        yield ("camera",), "give either camera or cameras, not both"
    things = _parts(_get(scene, "objects"))
    known = {str(_get(thing, "name") or f"object{i + 1}"): thing for i, thing in enumerate(things)}
    for path, camera in _cameras(scene):
        name = _get(camera, "fit")
        if isinstance(name, str) and name not in known:
            yield (*path, "fit"), _no("object", name, known)


def _object_faults(scene: Any, thing: Any) -> Iterator[Fault]:
    """Names of meshes and materials in one object, and its overrides of material parameters."""
    meshes, materials = (_names(_get(scene, kind)) for kind in ("meshes", "materials"))
    mesh, material, fallback = (_get(thing, key) for key in ("mesh", "material", "fallback"))
    if isinstance(mesh, str) and mesh not in meshes and "." not in mesh:
        yield ("mesh",), _no("mesh", mesh, meshes)
    for key, name in (("fallback", fallback), ("material", material)):
        if isinstance(name, str) and name not in materials:
            yield (key,), _no("material", name, materials)
    override, is_known = _get(thing, "override"), not isinstance(material, str) or material in materials
    if is_known and isinstance(override, dict) and override:
        base = materials[material] if isinstance(material, str) else material
        for path, fact in _override_faults(base, override):
            yield ("override", *path), fact


def _name_faults(kind: str, things: Any) -> Iterator[Fault]:
    """Names that two objects or two lights share, default names included, and lights named like a layer."""
    taken = {_default_name(kind, thing, i + 1) for i, thing in enumerate(things) if not _get(thing, "name")}
    for i, thing in enumerate(things):
        name = _get(thing, "name")
        if not isinstance(name, str):
            continue
        layer = owner_of(name) if kind == "lights" else None
        if layer is not None:
            yield (kind, i, "name"), f"the layer {layer} has the name '{name}'; give the light another"
        elif name in taken:
            yield (kind, i, "name"), f"the name '{name}' is taken"
        else:
            taken.add(name)


def _cameras(scene: Any) -> Iterator[tuple[Path, Any]]:
    yield ("camera",), _get(scene, "camera")
    for name, camera in _names(_get(scene, "cameras")).items():
        yield ("cameras", name), camera


def _default_name(kind: str, thing: Any, number: int) -> str:
    """Name of the object or light of this number if the scene gives it none."""
    return f"{'object' if kind == 'objects' else _get(thing, 'light')}{number}"


def _override_faults(material: Any, override: dict[str, Any]) -> Iterator[Fault]:
    """Faults of the overrides alone; those of the material are reported at its own place."""
    if isinstance(material, Description):
        base = dict(material)
    else:
        base = material if isinstance(material, dict) else {"model": "lambert"}
    try:
        model = member("illumcli.models", base["model"])
    except (LookupError, TypeError, BrokenMember):
        return
    merged = {**base, **override}
    try:
        model.model_validate(merged)
    except ValidationError as error:
        for path, fact in faults(error, model, merged):
            if path[:1] and path[0] in override:
                yield path, fact


def _no(kind: str, name: str, known: Mapping[str, Any]) -> str:
    plural = {"mesh": "meshes"}.get(kind, f"{kind}s")
    advice = suggestion(name, tuple(known)) if known else f"the scene has no {plural}"
    return f"no {kind} '{name}'; {advice}"


def _get(thing: Any, key: str) -> Any:
    return thing.get(key) if isinstance(thing, dict) else getattr(thing, key, None)


def _names(thing: Any) -> Mapping[str, Any]:
    return thing if isinstance(thing, dict) else {}


def _parts(thing: Any) -> Any:
    return thing if isinstance(thing, list | tuple) else ()
