"""The controls of a scene: every parameter of its picture, from the descriptions in force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, get_args

from illumcli.commands.schema_generator import schema_of_field
from illumcli.models._parameters import CurveOverSurface
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Object, Scene
from illumcli.scene.yaml_text import flow
from illumcli.schema.annotations import field_annotation, is_tag, split
from illumcli.schema.description import Description, as_json
from illumcli.schema.docs import summary, unit_in
from illumcli.viewer.choices import holds_descriptions, tag_value, tags_in
from illumcli.viewer.control import Control, Schema, shape_of, slider_of, without_null

ABSENT: Any = object()
"""In place of a value that the scene file does not have, because another description stands there."""
VARIES = "It varies with the frame; a change is for all frames."


class Spot(NamedTuple):
    """Where a control is, in the scene and on the page."""

    path: str
    group: str
    words: tuple[str, ...] = ()
    """Of its label."""

    def at(self, name: str) -> Spot:
        """The spot of a part."""
        return self._replace(path=f"{self.path}.{name}", words=(*self.words, name.replace("_", " ")))


class Controlled(NamedTuple):
    """A control, and what it controls."""

    control: Control
    annotation: Any
    """Of the part of the scene."""
    part: Any
    """What stands there now."""


def controls(original: SceneFile, now: SceneFile) -> tuple[Control, ...]:
    """The controls of a scene, group by group.

    Parameters
    ----------
    original : SceneFile
        The scene as its file has it.
    now : SceneFile
        The scene with the changes that were made.
    """
    lights = {light.name: str(number) for number, light in enumerate(now.scene.lights)}

    def varies(control: Control) -> bool:
        path = control.path.split(".")
        if path[0] == "lights":
            path[1] = lights.get(path[1], path[1])
        return any(path[: len(steps)] == list(map(str, steps)) for steps in now.varying)

    return tuple(
        replace(each, help=f"{each.help} {VARIES}".strip()) if varies(each) else each
        for each in (entry.control for entry in controlled(original.scene, now.scene))
    )


def controlled(before: Scene, now: Scene) -> Iterator[Controlled]:
    """The controls of a scene, with the parts that they control; `before` is the scene of the file."""
    # Materials, lights and objects by name.
    for name, material in {**before.materials, **now.materials}.items():  # in the order of the file
        spot = Spot(f"materials.{name}", f"materials.{name}")
        old = before.materials.get(name, ABSENT)
        yield from _of_value(spot, {}, _annotation_of_parts("materials"), material, old)
    lights = before.named_lights()
    for number, (name, light) in enumerate(now.named_lights().items()):
        spot = Spot(f"lights.{light.name or number}", f"lights.{name}")
        annotation = _annotation_of_parts("lights")
        for entry in _of_value(spot, {}, annotation, light, lights.get(name, ABSENT)):
            if entry.control.path != f"{spot.path}.name":  # by which the other paths call it
                yield entry
    things = dict(zip(before.object_names(), before.objects, strict=True))
    for number, (name, thing) in enumerate(zip(now.object_names(), now.objects, strict=True)):
        spot = Spot(f"objects.{thing.name or number}", f"objects.{name}")
        old = {**dict(things[name]), "model": before.material_of(things[name])} if name in things else {}
        yield from _of_object(spot, now, thing, old)

    # The fields of the scene itself.
    for name in ("ambient", "obscurance", "depth_cue", "film"):
        yield from _of_field(Spot(name, name), Scene, name, getattr(now, name), getattr(before, name))
    for name in ("shading", "terminator"):
        spot = Spot(name, "shading", (name,))
        yield from _of_field(spot, Scene, name, getattr(now, name), getattr(before, name))
    cameras = before.named_cameras()
    for name, camera in now.named_cameras().items():
        path = f"cameras.{name}" if now.cameras else "camera"
        annotation = field_annotation(Scene, "camera")
        yield from _of_value(Spot(path, path), {}, annotation, camera, cameras.get(name, ABSENT))


def _annotation_of_parts(name: str) -> Any:
    """The annotation of the parts of a list or mapping of the scene."""
    parts = get_args(split(field_annotation(Scene, name))[0])
    return parts[1] if name == "materials" else parts[0]


def _of_object(spot: Spot, scene: Scene, thing: Object, old: Mapping[str, Any]) -> Iterator[Controlled]:
    """The rate of an object, materials that are described in place, and parameters that differ on it."""
    for name in ("material", "fallback"):
        material = getattr(thing, name)
        if isinstance(material, Description):
            before = old.get(name, ABSENT)
            yield from _of_value(spot.at(name), {}, _annotation_of_parts("materials"), material, before)
    model, before = scene.material_of(thing), old.get("model", ABSENT)
    if model is not None:
        for name in thing.override:
            given = getattr(before, name, ABSENT) if name in old.get("override", ()) else ABSENT
            yield from _of_field(spot.at("override").at(name), type(model), name, getattr(model, name), given)
    yield from _of_field(spot.at("shading"), Object, "shading", thing.shading, old.get("shading", ABSENT))


def _of_description(spot: Spot, now: Description, before: Any) -> Iterator[Controlled]:
    """The controls of the fields of a description; what stands there before may be something else."""
    cls = type(now)
    for name in cls.model_fields:
        if not is_tag(cls, name):
            old = getattr(before, name) if type(before) is cls else ABSENT
            yield from _of_field(spot.at(name), cls, name, getattr(now, name), old)


def _of_field(spot: Spot, cls: type[Description], name: str, value: Any, before: Any) -> Iterator[Controlled]:
    return _of_value(spot, schema_of_field(cls, name), field_annotation(cls, name), value, before)


def _of_value(spot: Spot, schema: Schema, annotation: Any, value: Any, before: Any) -> Iterator[Controlled]:
    """The control of a value, and those of the values in it."""
    is_part = holds_descriptions(annotation)
    if not is_part:
        if not isinstance(value, Mapping):
            yield Controlled(_leaf(spot, schema, value, before), annotation, value)
    elif without_null(schema)[1]:
        yield Controlled(_switch(spot, schema, value, before), annotation, value)
    if is_part and isinstance(value, Description):
        for tag in tag_value(type(value)):
            yield Controlled(
                _choice(spot.at(tag), schema, tags_in(annotation), value, before), annotation, value
            )

    # The parts of a description, a list of descriptions, or a mapping of values by name. Those of a curve are
    # no parts of the scene, whose text has the curve in its own words.
    if isinstance(value, CurveOverSurface):
        return
    if isinstance(value, Description):
        yield from _of_description(spot, value, before)
    elif isinstance(value, Mapping):
        inner = get_args(split(annotation)[0])[1]
        (part,) = schema.get("patternProperties", {"": {}}).values()
        for name, each in value.items():
            old = before.get(name, ABSENT) if isinstance(before, Mapping) else ABSENT
            yield from _of_value(spot.at(name), {**part, "description": ""}, inner, each, old)
    elif isinstance(value, tuple):
        for number, each in enumerate(value):
            if isinstance(each, Description):
                known = isinstance(before, tuple) and number < len(before)
                yield from _of_description(spot.at(str(number)), each, before[number] if known else ABSENT)


def _leaf(spot: Spot, schema: Schema, value: Any, before: Any) -> Control:
    """The control of a value as a whole."""
    shape, default = shape_of(schema), schema.get("default")
    if isinstance(value, Description | str) and shape.kind != "choice":
        shape = shape._replace(kind="text", number={})
    value, default = as_json(value), as_json(default)
    old = default if before is ABSENT else as_json(before)
    is_signed = shape.kind == "color" and shape.number["minimum"] < 0
    if is_signed:  # a number of a formula: three equal ones, or three that are no colour
        is_one = len(set(value)) == 1
        shape = shape._replace(kind="number" if is_one else "vector")
        value = value[0] if is_one else value
        old = old[0] if is_one and isinstance(old, list) else old
    slider = slider_of(shape, (old, default, value))
    if shape.kind == "text":
        value, default, old = (None if each is None else flow(each) for each in (value, default, old))
    return Control(
        **_named(spot, schema.get("description", "")),
        kind=shape.kind,
        value=value,
        default=default,
        original=None if before is ABSENT else old,
        **(slider._asdict() if slider else {}),
        choices=shape.choices,
        unit=unit_in(schema.get("description", "")) if shape.number else "",
        changed=value != old,
        optional=shape.optional,
    )


def _switch(spot: Spot, schema: Schema, value: Any, before: Any) -> Control:
    """The control that adds a description to the scene, or removes it."""
    spot = spot if spot.words else spot._replace(words=(spot.path.replace("_", " "),))
    return Control(
        **_named(spot, schema.get("description", "")),
        kind="switch",
        value=value is not None,
        default=False,
        original=before is not None,
        changed=(value is None) != (before is None),
    )


def _choice(spot: Spot, schema: Schema, tags: tuple[str, ...], value: Description, before: Any) -> Control:
    """The control that chooses which description stands there."""
    name, old = spot.path.rpartition(".")[2], getattr(before, spot.path.rpartition(".")[2], None)
    about = f"{schema.get('description', '')} {summary(type(value))}".strip()
    default = schema.get("default")
    return Control(
        **_named(spot, about),
        kind="choice",
        value=getattr(value, name),
        default=default.get(name) if isinstance(default, Mapping) else None,
        original=old,
        choices=tags,
        changed=old != getattr(value, name),
    )


def _named(spot: Spot, text: str) -> dict[str, Any]:
    """Path, group, label and help text of a control."""
    words = [word for word, before in zip(spot.words, ("", *spot.words), strict=False) if word != before]
    return {"path": spot.path, "group": spot.group, "label": " ".join(words), "help": text}
