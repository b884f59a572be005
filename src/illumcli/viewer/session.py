"""One window: its messages, what it shows, and the pictures that follow."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Condition
from typing import Any

from illumcli.errors import InputError, known
from illumcli.layers import FIXED, PER_LIGHT
from illumcli.rays.viewpoints import Camera
from illumcli.scene.scene_file import SceneFile
from illumcli.viewer.cameras import dollied, orbited, panned, placement
from illumcli.viewer.messages import Message, coalesced
from illumcli.viewer.pictures import Picture, Renderer
from illumcli.viewer.quality import Coarse
from illumcli.viewer.shown import Shown, camera_path

Send = Callable[[str | bytes], None]
"""Sends a message to the page."""


class Superseded(Exception):
    """A newer message makes a picture in progress useless."""


class Session:
    """What one window shows; two threads use it: one receives messages, the other renders.

    Parameters
    ----------
    renderer : Renderer
        Of the scene; this session's own.
    send : callable
        Sends a text or bytes to the page; called by both threads.
    """

    def __init__(self, renderer: Renderer, send: Send) -> None:
        self._renderer = renderer
        self._send = send
        self._news = Condition()
        self._pending: list[Message] = []
        self._is_closed = False
        self._stamp: float | None = None
        self._picture: Picture | None = None
        self._loaded: SceneFile | None = None
        self._shown = Shown("main")

    def receive(self, text: str | bytes) -> None:
        """Take a message of the page."""
        try:
            message = json.loads(text)
            kind = message["type"]
        except (ValueError, TypeError, KeyError):
            self._tell_problem([f"message: not understood: {text[:80]!r}"], "edit")
            return
        if kind == "pick":
            self._answer_pick(message)
            return
        with self._news:
            self._pending.append(message)
            self._news.notify()

    def close(self) -> None:
        """End `run`."""
        with self._news:
            self._is_closed = True
            self._news.notify()

    def run(self) -> None:
        """Render until the session is closed: the newest state, first coarse, then in full."""
        self._begin()
        while not self._is_closed:
            try:
                self._render()
            except Superseded:
                pass
            except Exception as error:
                if (fault := known(error)) is None:
                    raise
                self._tell_problem(str(fault).splitlines(), "edit")
            with self._news:
                self._news.wait_for(lambda: self._pending or self._is_closed)
            self._settle()

    def _begin(self) -> None:
        loaded = self._loaded = self._renderer.loaded(())
        self._shown = Shown(next(iter(loaded.scene.named_cameras())))
        self._tell_scene()

    def _settle(self) -> None:
        """Apply the messages that came; each that is faulty is reported and has no effect."""
        with self._news:
            messages, self._pending = self._pending, []
        for message in coalesced(messages):
            self._stamp = message.get("stamp", self._stamp)
            try:
                self._apply(message)
            except InputError as error:
                self._tell_problem(error.problems, "edit")
            except (KeyError, TypeError, ValueError) as error:
                self._tell_problem([f"message: not understood: {error}: {json.dumps(message)[:80]}"], "edit")

    def _apply(self, message: Message) -> None:
        """Change what is shown as a message says."""
        assert self._loaded is not None
        shown, loaded = self._shown, self._loaded
        edits: Mapping[str, Any] = shown.edits
        match message["type"]:
            case "view":
                self._shown = _with_view(shown, message, loaded)
                return
            case "set":
                edits = {**edits, str(message["path"]): message["value"]}
            case "reset":
                path = message.get("path")
                edits = {name: value for name, value in edits.items() if path is not None and name != path}
            case "move":
                camera = _moved(self._camera(), message)
                path = camera_path(loaded.scene, shown.camera)
                edits = {**edits, **{f"{path}.{name}": value for name, value in placement(camera).items()}}
            case kind:
                raise ValueError(f"no type '{kind}'")
        self._loaded = self._renderer.loaded([f"{path}={json.dumps(value)}" for path, value in edits.items()])
        self._shown = replace(shown, edits=edits)

    def _camera(self) -> Camera:
        """The camera as it is placed."""
        assert self._loaded is not None
        camera = self._loaded.scene.named_cameras()[self._shown.camera]
        if camera.fit is None or self._picture is None:
            return camera
        return self._picture.image.target.view.camera

    def _render(self) -> None:
        for coarse in (Coarse(), None):
            assert self._loaded is not None
            picture = self._renderer.picture(self._shown, self._loaded, coarse, self._unless_newer)
            self._picture = picture
            header = {
                "type": "picture",
                "stage": "full" if coarse is None else "coarse",
                "layer": picture.layer,
                "camera": picture.shown.camera,
                "width": picture.image.target.view.width,
                "height": picture.image.target.height,
                "seconds": picture.seconds,
                "rays": sum(picture.report.rays.values()),
                "error": picture.error,
                "stamp": self._stamp,
            }
            text = json.dumps(header).encode()
            self._send(struct.pack("<I", len(text)) + text + picture.jpeg())
            self._unless_newer("", 0, 0)

    def _unless_newer(self, what: str, done: int, total: int) -> None:
        """Called while a picture is rendered."""
        if self._pending or self._is_closed:
            raise Superseded

    def _answer_pick(self, message: Message) -> None:
        picture, loaded = self._picture, self._loaded
        if picture is None or loaded is None:
            return
        layers = picture.layers()
        height, width = next(iter(layers.values())).shape[:2]
        x, y = (min(n - 1, max(0, int(message[k] * n))) for k, n in (("x", width), ("y", height)))
        target = picture.image.target
        names = {
            layer.name: [name.rpartition(".")[2] for name in picture.image.work.development.names(layer)]
            for layer in target.layers
        }
        values = {
            name: dict(zip(names[name], (each.item() for each in layers[name][y, x]), strict=True))
            for name in layers
        }
        answer: dict[str, Any] = {
            "type": "pixel",
            "x": x,
            "y": y,
            "layers": values,
            "stamp": message.get("stamp"),
        }
        if "object_id" in values and (number := int(values["object_id"]["Y"])) > 0:
            thing = loaded.scene.objects[number - 1]
            answer["object"] = loaded.scene.object_names()[number - 1]
            answer["material"] = thing.material if isinstance(thing.material, str) else None
        self._tell(answer)

    def _tell_scene(self) -> None:
        assert self._loaded is not None
        scene, shown = self._loaded.scene, self._shown
        lights = scene.named_lights()
        per_light = [(row, light) for row in PER_LIGHT.values() for light in lights]
        self._tell(
            {
                "type": "scene",
                "name": self._loaded.name,
                "cameras": list(scene.named_cameras()),
                "layers": [
                    *({"name": layer.name, "help": layer.text} for layer in FIXED.values()),
                    *({"name": row.of(light).name, "help": row.text} for row, light in per_light),
                ],
                "lights": [{"name": name, "kind": dict(light)["light"]} for name, light in lights.items()],
                "models": [],
                "materials": [
                    {"name": name, "model": dict(model)["model"], "objects": []}
                    for name, model in scene.materials.items()
                ],
                "controls": [],
                "edits": dict(shown.edits),
                "view": {"camera": shown.camera, "layer": shown.layer},
                "film": [scene.film.width, scene.film.height],
            }
        )

    def _tell_problem(self, lines: Any, origin: str) -> None:
        self._tell({"type": "problem", "lines": list(lines), "from": origin})

    def _tell(self, answer: Mapping[str, Any]) -> None:
        self._send(json.dumps(answer))


def _with_view(shown: Shown, message: Message, loaded: SceneFile) -> Shown:
    """What is shown after a message about the view."""
    changes: dict[str, Any] = {}
    if "camera" in message:
        if message["camera"] not in loaded.scene.named_cameras():
            raise ValueError(f"no camera '{message['camera']}'")
        changes["camera"] = message["camera"]
    if "layer" in message:
        changes["layer"] = str(message["layer"])
    if "exposure" in message:
        changes["exposure"] = float(message["exposure"])
    if "width" in message and "height" in message:
        changes["size"] = (int(message["width"]), int(message["height"]))
    if "hidden_lights" in message:
        changes["hidden_lights"] = frozenset(message["hidden_lights"])
    return replace(shown, **changes)


def _moved(camera: Camera, message: Message) -> Camera:
    if "orbit" in message:
        return orbited(camera, *message["orbit"])
    if "pan" in message:
        return panned(camera, *message["pan"])
    return dollied(camera, float(message["dolly"]))
