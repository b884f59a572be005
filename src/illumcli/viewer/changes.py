"""What a message of the page changes in a window."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from illumcli.errors import InputError
from illumcli.layers import FIXED, PER_LIGHT
from illumcli.rays.viewpoints import Camera
from illumcli.render_graph.needs import layers
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene
from illumcli.schema.messages import suggestion
from illumcli.viewer.cameras import MOTIONS, placement
from illumcli.viewer.edits import Edits, after_reset, after_set, overrides_of
from illumcli.viewer.messages import Message
from illumcli.viewer.window import Window, camera_path

LARGEST = 8192
"""Pixels of a picture's side, at most."""
STOPS = 64
"""Exposure, at most [stops]."""
FARTHEST = 100.0
"""A motion of one message, at most [heights of the picture]."""
Load = Callable[[Sequence[str]], SceneFile]
"""Loads the scene with the overrides of edits; raises InputError."""


def changed(window: Window, message: Message, load: Load, camera: Camera) -> Window:
    """The window after a message that changes it.

    Parameters
    ----------
    load : callable
        Loads the scene with overrides.
    camera : Camera
        The window's camera where it is now, though the scene says only what it fits.

    Raises
    ------
    InputError
        A value that the scene cannot have.
    Exception
        One of `messages.MISUNDERSTOOD`.
    """
    edits = window.edits
    match message["type"]:
        case "view":
            return _looking(window, message)
        case "set":
            edits = after_set(window.original, window.now, edits, str(message["path"]), message["value"])
        case "reset":
            path = message.get("path")
            edits = after_reset(window.original, window.now, edits, None if path is None else str(path))
        case "move":
            for name, value in _moves(window.now.scene, window.camera, camera, message):
                edits = after_set(window.original, window.now, edits, name, value)
        case "restore":
            restored = with_edits(window, dict(message["edits"]), load)
            return _looking(restored, message.get("view", {}))
        case kind:
            raise ValueError(f"no type '{kind}'")
    return with_edits(window, edits, load)


def with_edits(window: Window, edits: Edits, load: Load) -> Window:
    """The window with other edits; a camera, layer or light that it shows and that is gone is left.

    Raises
    ------
    InputError
        Edits that the scene cannot have.
    """
    if list(edits.items()) == list(window.edits.items()):
        return window
    return fitted(replace(window, now=load(overrides_of(edits)), edits=edits))


def reread(window: Window | None, original: SceneFile, load: Load) -> tuple[Window, Sequence[str]]:
    """The window on a scene that was read anew, and the problems of edits that it cannot have any more; the
    first window if there is none."""
    scene = original.scene
    if window is None:
        return Window(original, original, next(iter(scene.named_cameras())), first_layer(scene)), ()
    kept, problems = fitted(replace(window, original=original, now=original, edits={})), list[str]()
    try:
        return with_edits(kept, window.edits, load), ()
    except InputError:
        for path, value in window.edits.items():
            try:
                kept = with_edits(kept, {**kept.edits, path: value}, load)
            except InputError as error:
                problems += error.problems
    return kept, problems


def fitted(window: Window) -> Window:
    """The window without choices that its scene does not offer any more."""
    scene = window.now.scene
    return replace(
        window,
        camera=window.camera if window.camera in scene.named_cameras() else next(iter(scene.named_cameras())),
        layer=window.layer if window.layer in layer_names(scene) else "beauty",
        hidden_lights=window.hidden_lights & scene.named_lights().keys(),
    )


def layer_names(scene: Scene) -> dict[str, str]:
    """Layer -> what it holds, of all that a scene has."""
    of_lights = {
        row.of(light).name: f"{row.text.rstrip('.').replace(', a layer each', '')}: {light}."
        for row in PER_LIGHT.values()
        for light in scene.named_lights()
    }
    return {name: layer.text for name, layer in FIXED.items()} | of_lights


def first_layer(scene: Scene) -> str:
    """The first layer that a scene asks for."""
    return layers(scene, scene.outputs.layers)[0].name


def _looking(window: Window, message: Message) -> Window:
    """The window with the camera, layer, exposure, size and lights that a message names."""
    scene = window.now.scene
    changes: dict[str, Any] = {}
    for name, known in (("camera", scene.named_cameras()), ("layer", layer_names(scene))):
        if name in message:
            changes[name] = _one_of(name, message[name], known)
    if "exposure" in message:
        stops = float(message["exposure"])
        if not abs(stops) <= STOPS:
            raise InputError(f"exposure: must be between {-STOPS} and {STOPS} stops, is {stops:g}")
        changes["exposure"] = stops
    if "width" in message or "height" in message:
        size = int(message["width"]), int(message["height"])
        if not all(1 <= each <= LARGEST for each in size):
            raise InputError(f"picture: width and height must be 1 to {LARGEST}, are {size[0]} and {size[1]}")
        changes["size"] = size
    if "hidden_lights" in message:
        lights = scene.named_lights()
        changes["hidden_lights"] = frozenset(
            _one_of("light", each, lights) for each in message["hidden_lights"]
        )
    return replace(window, **changes)


def _one_of(what: str, name: Any, known: Mapping[str, Any]) -> str:
    if name not in known:
        raise InputError(f"no {what} '{name}'; {suggestion(str(name), tuple(known))}")
    return str(name)


def _moves(scene: Scene, name: str, camera: Camera, message: Message) -> list[tuple[str, Any]]:
    """Path and value of what changes where a camera moves; nothing if it stays."""
    moved = _moved(camera, message)
    if moved == camera:
        return []
    before = scene.named_cameras()[name]
    parts = placement(moved)
    if before.fit is None:
        parts = {key: value for key, value in parts.items() if value != _plain(getattr(before, key))}
    return [(f"{camera_path(scene, name)}.{key}", value) for key, value in parts.items()]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _moved(camera: Camera, message: Message) -> Camera:
    """The camera after the motion of a message."""
    kind = next((kind for kind in MOTIONS if kind in message), "orbit")
    motion = message[kind] if isinstance(message[kind], list) else [message[kind]]
    if not all(math.isfinite(each) and abs(each) <= FARTHEST for each in motion):
        raise ValueError("a motion is a few heights of the picture")
    return MOTIONS[kind](camera, *motion) if any(motion) else camera
