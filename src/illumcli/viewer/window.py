"""What a window shows: its scene with edits, camera, layer, size, exposure, lights that are off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from illumcli.records import Value
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene
from illumcli.schema.description import Description
from illumcli.viewer.edits import Edits, overrides_of


class Window(Value):
    """What a window shows of a scene."""

    original: SceneFile
    """The scene as its file and the command line have it."""
    now: SceneFile
    """The scene with the edits."""
    camera: str
    layer: str
    edits: Edits = field(default_factory=dict)
    """Moves of the camera among them."""
    exposure: float | None = None
    """[stops]; by default the scene's."""
    size: tuple[int, int] | None = None
    """Width and height [pixels]; by default the scene's."""
    hidden_lights: frozenset[str] = frozenset()

    @property
    def scene(self) -> Scene:
        """The scene whose picture is shown."""
        return with_values(self.now.scene, self._values())

    @property
    def overrides(self) -> tuple[str, ...]:
        """The texts of `-D` with which ``illum render`` makes this picture."""
        return (*overrides_of(self.edits), *overrides_of(self._values()))

    @property
    def film(self) -> tuple[int, int]:
        """Width and height of the picture [pixels]."""
        return self.size or self.own_film

    @property
    def own_film(self) -> tuple[int, int]:
        """Width and height that the scene asks for [pixels]."""
        return self.now.scene.film_of(self.camera)[:2]

    @property
    def choices(self) -> tuple[Any, ...]:
        """All that the window shows of its scene file; equal for equal pictures."""
        return self.camera, self.layer, [*self.edits.items()], self.exposure, self.size, self.hidden_lights

    def _values(self) -> dict[str, Any]:
        """Value by path of what the window chooses beside edits."""
        scene, values = self.now.scene, dict[str, Any]()
        if self.exposure not in (None, scene.film.exposure):
            values["film.exposure"] = self.exposure
        if self.size not in (None, self.own_film):
            camera = scene.named_cameras()[self.camera]
            for name, number in zip(("width", "height"), self.film, strict=True):
                own = getattr(camera, name) is not None
                values[f"{camera_path(scene, self.camera) if own else 'film'}.{name}"] = number
        for name, light in scene.named_lights().items():
            if name in self.hidden_lights:
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
    """A part with a value at a path in it; a light is called by its name."""
    if not steps:
        return value
    step, rest = steps[0], steps[1:]
    if isinstance(part, Description):
        return part.model_copy(update={step: _with(getattr(part, step), rest, value, scene)})
    if isinstance(part, Mapping):
        return {**part, step: _with(part[step], rest, value, scene)}
    number = list(scene.named_lights()).index(step)
    return tuple(_with(each, rest, value, scene) if i == number else each for i, each in enumerate(part))
