"""What a window shows: edits of its scene, camera, layer, size, exposure, lights that are off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from illumcli.records import Value
from illumcli.scene.spec import Scene
from illumcli.schema.description import Description


class Shown(Value):
    """What a window shows of a scene."""

    camera: str
    layer: str = "beauty"
    edits: Mapping[str, Any] = field(default_factory=dict)
    """Value by path, in turn, as `-D` sets it; moves of the camera among them."""
    exposure: float | None = None
    """[stops]; by default the scene's."""
    size: tuple[int, int] | None = None
    """Width and height [pixels]; by default the scene's."""
    hidden_lights: frozenset[str] = frozenset()


def view_values(shown: Shown, scene: Scene) -> dict[str, Any]:
    """Value by path of what a window chooses beside edits; with these, ``illum render`` makes its picture."""
    values: dict[str, Any] = {}
    if shown.exposure is not None:
        values["film.exposure"] = shown.exposure
    if shown.size is not None:
        camera = scene.named_cameras()[shown.camera]
        for name, number in zip(("width", "height"), shown.size, strict=True):
            own = getattr(camera, name) is not None
            values[f"{camera_path(scene, shown.camera) if own else 'film'}.{name}"] = number
    for name, light in scene.named_lights().items():
        if name in shown.hidden_lights:
            values[f"lights.{name}.{light.emission_field}"] = (0.0, 0.0, 0.0)
    return values


def camera_path(scene: Scene, name: str) -> str:
    """The path of a camera in its scene."""
    return f"cameras.{name}" if scene.cameras else "camera"


def with_values(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """A scene with valid values at some paths, which it has."""
    for path, value in values.items():
        scene = _with(scene, path.split("."), value, scene)
    return scene


def _with(part: Any, steps: Sequence[str], value: Any, scene: Scene) -> Any:
    if not steps:
        return value
    step, rest = steps[0], steps[1:]
    if isinstance(part, Description):
        return part.model_copy(update={step: _with(getattr(part, step), rest, value, scene)})
    if isinstance(part, Mapping):
        return {**part, step: _with(part[step], rest, value, scene)}
    number = list(scene.named_lights()).index(step)
    return tuple(_with(each, rest, value, scene) if i == number else each for i, each in enumerate(part))
