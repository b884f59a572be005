"""The changes of a window to its scene: values by path, in the order in which they apply, as -D has them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from pydantic import ValidationError

from illumcli.errors import InputError
from illumcli.scene.override import parse
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.source import Problem
from illumcli.scene.spec import Scene
from illumcli.scene.yaml_text import flow
from illumcli.schema.annotations import split
from illumcli.schema.description import Description, as_json
from illumcli.schema.families import member
from illumcli.viewer.choices import class_of, holds_descriptions
from illumcli.viewer.controls import ABSENT, Controlled, controlled
from illumcli.viewer.switching import switched

MODELS = "illumcli.models"
Edits: TypeAlias = Mapping[str, Any]
"""Path -> value as JSON has it; None removes the part. No path is below another one."""


def overrides_of(edits: Edits) -> tuple[str, ...]:
    """The edits as `PATH=VALUE`."""
    return tuple(f"{path}={flow(value)}" for path, value in edits.items())


def after_set(original: SceneFile, now: SceneFile, edits: Edits, path: str, value: Any) -> dict[str, Any]:
    """The edits with the value of a control in them; a value that is the file's own is no edit.

    The value of a tag, such as `materials.clay.model`, brings a description of the tag's class with the
    values that both have, and removes what objects override of a material and the new model does not take.
    Text of controls that are no choice is YAML.

    Parameters
    ----------
    original : SceneFile
        As its file is.
    now : SceneFile
        With the edits.

    Raises
    ------
    InputError
        There is no such tag, it needs what only the scene file can say, or the text is no YAML.
    """
    chosen, value = _meant(original.scene, now.scene, path, value)
    steps, value = _whole(now, tuple(chosen.split(".")), value)
    new = _put(original.scene, edits, steps, value)
    if chosen != path and steps[0] == "materials" and len(steps) == 2:
        for each in _overridden(now.scene, steps[1]):
            if not _takes(value, each[-1], part_at(now.scene, each)):
                new = _put(original.scene, new, each, None)
    return new


def after_reset(original: SceneFile, now: SceneFile, edits: Edits, path: str | None = None) -> dict[str, Any]:
    """The edits without those of a control and of what is below it, or without all; arguments as above."""
    if path is None:
        return {}
    steps = tuple(path.split("."))
    entry = _control_at(original.scene, now.scene, path)
    if entry is not None and _is_tag(entry):
        new = after_reset(original, now, edits, ".".join(steps[:-1]))
        if steps[0] == "materials" and len(steps) == 3:
            removed = {path for path, value in edits.items() if value is None}
            for each in {".".join(each) for each in _overridden(original.scene, steps[1])} & removed:
                new = _without(new, each)
        return new
    if _above(edits, path) is None:
        return _without(edits, path)
    before = part_at(original.scene, steps)
    return _put(original.scene, edits, steps, None if before is ABSENT else as_json(before))


def _put(original: Scene, edits: Edits, steps: Sequence[str], value: Any) -> dict[str, Any]:
    """The edits with a value at a path, in the edit of the part around it if there is one."""
    path = ".".join(steps)
    above = _above(edits, path)
    if above is not None:
        value = _with(edits[above], path.removeprefix(f"{above}.").split("."), value)
        path = above
    if _same(part_at(original, path.split(".")), value):
        return _without(edits, path)
    return {**(edits if path in edits else _without(edits, path)), path: value}


def _without(edits: Edits, path: str) -> dict[str, Any]:
    """The edits without those of a part and of what is in it."""
    return {each: edits[each] for each in edits if not f"{each}.".startswith(f"{path}.")}


def _overridden(scene: Scene, material: str) -> Iterator[tuple[str, ...]]:
    """The paths of the parameters of a material that differ on an object."""
    for number, thing in enumerate(scene.objects):
        if material in (thing.material, thing.fallback):
            yield from (("objects", thing.name or str(number), "override", key) for key in thing.override)


def _takes(material: Mapping[str, Any], key: str, value: Any) -> bool:
    """True if a material may have this value of a parameter."""
    try:
        member(MODELS, material["model"]).model_validate({**material, key: value})
    except ValidationError:
        return False
    return True


def part_at(scene: Scene, steps: Sequence[str]) -> Any:
    """The value at a path of a scene, where lights and objects may have names; ABSENT if there is none."""
    part: Any = scene
    for step in _numbered(scene, steps):
        if isinstance(part, Mapping):
            part = part.get(str(step), ABSENT)
        elif isinstance(part, tuple | list):
            part = part[step] if isinstance(step, int) and step < len(part) else ABSENT
        else:
            is_field = isinstance(part, Description) and step in type(part).model_fields
            part = getattr(part, str(step)) if is_field else ABSENT
    return part


def _numbered(scene: Scene, steps: Sequence[str]) -> tuple[str | int, ...]:
    """The path with numbers in the place of the names of lights and objects."""
    names = {"lights": list(scene.named_lights()), "objects": list(scene.object_names())}.get(steps[0], [])
    numbered = [
        names.index(step) if place == 1 and step in names else int(step) if step.isdigit() else step
        for place, step in enumerate(steps)
    ]
    return tuple(numbered)


def _meant(before: Scene, now: Scene, path: str, value: Any) -> tuple[str, Any]:
    """The path and value that the setting of a control means."""
    if not isinstance(value, str | bool):
        return path, value
    entry = _control_at(before, now, path)
    if entry is None:
        return path, value
    kind = entry.control.kind
    if kind == "switch" and holds_descriptions(entry.annotation):
        return path, switched(None, split(entry.annotation)[0], _reach(now)) if value else None
    if _is_tag(entry):
        return path.rpartition(".")[0], _chosen(entry, value, _reach(now))
    if kind in ("switch", "choice"):
        return path, value
    problems: list[Problem] = []
    change = parse(f"{path}={value}", problems)
    if change is None:
        raise InputError([f"{path}: {problem.fact}" for problem in problems])
    return path, change.value.plain()


def _control_at(before: Scene, now: Scene, path: str) -> Controlled | None:
    """The control of a path; None if there is none."""
    return next((each for each in controlled(before, now) if each.control.path == path), None)


def _is_tag(entry: Controlled) -> bool:
    """True if a control chooses which description stands there."""
    return entry.control.kind == "choice" and isinstance(entry.part, Description)


def _chosen(entry: Controlled, tag: Any, reach: float) -> dict[str, Any]:
    """The keys of the description that a tag chooses."""
    try:
        return switched(entry.part, class_of(entry.annotation, str(tag)), reach)
    except LookupError as error:
        raise InputError(f"{entry.control.path}: no choice '{tag}'; {error}") from None
    except InputError as error:
        raise InputError([f"{entry.control.path}: {problem}" for problem in error.problems]) from None


def _reach(scene: Scene) -> float:
    """A distance that is long in the scene: twice that of the first camera from what it looks at."""
    camera = next(iter(scene.named_cameras().values()))
    return float(f"{2 * math.dist(camera.position, camera.target):.2g}")


def _whole(now: SceneFile, steps: tuple[str, ...], value: Any) -> tuple[tuple[str, ...], Any]:
    """The path and value to put into the scene's tree: those of the description around the value, if it is
    not written there, or in short, as in `ambient: [0.4, 0.4, 0.4]`."""
    for number in range(1, len(steps)):
        around, inside = steps[:number], steps[number:]
        node, part = now.tree.find(_numbered(now.scene, around)), part_at(now.scene, around)
        if not isinstance(part, Description) or (node is not None and isinstance(node.value, dict)):
            continue
        keys = as_json(part)
        return (around, _with(keys, inside, value)) if keys or node is not None else (steps, value)
    return steps, value


def _above(edits: Edits, path: str) -> str | None:
    """The edit of a mapping or list that a path leads into; None if there is none."""
    return next((each for each in edits if path.startswith(f"{each}.")), None)


def _with(part: Any, steps: Sequence[str], value: Any) -> Any:
    """A mapping or list with a value at a path in it; None removes a key."""
    step, rest = steps[0], steps[1:]
    if isinstance(part, list):
        number = int(step)
        new = _with(part[number], rest, value) if rest else value
        return [*part[:number], new, *part[number + 1 :]]
    new = _with(part.get(step, {}), rest, value) if rest else value
    if new is None:
        return {key: each for key, each in part.items() if key != step}
    return {**part, step: new}


def _same(before: Any, value: Any) -> bool:
    """True if a value in JSON is that of a description; one number is three equal ones."""
    if isinstance(before, Description) and isinstance(value, Mapping):
        try:
            return dict(type(before).model_validate(value)) == dict(before)
        except ValidationError:
            return False
    before, is_number = as_json(before), isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(before, list) and is_number:
        return bool(before == [value] * len(before))
    return bool(before == value) and isinstance(before, bool) == isinstance(value, bool)
