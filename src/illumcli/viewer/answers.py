"""What the page is told: the scene, its controls, pictures, values under the mouse."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from illumcli.records import Value
from illumcli.schema.docs import summary
from illumcli.schema.families import members, tag_of
from illumcli.viewer.changes import layer_names
from illumcli.viewer.control import Control
from illumcli.viewer.pictures import Picture
from illumcli.viewer.quality import stage
from illumcli.viewer.window import Window


def scene_answer(window: Window, controls: Sequence[Control]) -> dict[str, Any]:
    """The scene, with everything that the page offers."""
    scene = window.now.scene
    users: dict[str, list[str]] = {name: [] for name in scene.materials}
    for name, thing in zip(scene.object_names(), scene.objects, strict=True):
        for material in (thing.material, thing.fallback):
            if isinstance(material, str):
                users[material].append(name)
    return {
        "type": "scene",
        "name": window.now.name,
        "file": str(window.now.path),
        "cameras": list(scene.named_cameras()),
        "layers": [{"name": name, "help": text} for name, text in layer_names(scene).items()],
        "lights": [
            {"name": name, "kind": dict(light)["light"]} for name, light in scene.named_lights().items()
        ],
        "models": _models(),
        "materials": [
            {"name": name, "model": tag_of(type(model)), "objects": users[name]}
            for name, model in {**window.original.scene.materials, **scene.materials}.items()
        ],
        "controls": [control.as_data() for control in controls],
        "edits": dict(window.edits),
        "view": {
            "camera": window.camera,
            "layer": window.layer,
            "exposure": scene.film.exposure if window.exposure is None else window.exposure,
            "width": window.film[0],
            "height": window.film[1],
            "hidden_lights": sorted(window.hidden_lights),
        },
        "film": list(window.own_film),
    }


@cache
def _models() -> list[dict[str, str]]:
    """All models: name and title."""
    return [{"name": tag_of(model), "title": summary(model)} for model in members("illumcli.models")]


class Stated(Value):
    """An error that was stated of a picture."""

    version: int
    """Number of the change that the picture follows."""
    stage: str
    layer: str
    error: float


def picture_answer(picture: Picture, stamp: float | None, version: int, stated: Stated | None) -> bytes:
    """A picture with its header, for a frame of bytes.

    Parameters
    ----------
    version : int
        Number of the change that it follows.
    stated : Stated, optional
        The error that was stated last, of this picture or one before.
    """
    known = None
    if stated is not None and stated.layer == picture.window.layer:
        is_earlier = stated.version != version
        known = {"stage": stated.stage, "error": stated.error, "is_earlier": is_earlier}
    header = {
        "type": "picture",
        "stage": stage(picture.quality),
        "layer": picture.window.layer,
        "camera": picture.window.camera,
        "width": picture.size[0],
        "height": picture.size[1],
        "seconds": picture.seconds,
        "rays": picture.rays,
        "error": picture.error,
        "stated": known,
        "stamp": stamp,
    }
    text = json.dumps(header).encode()
    return struct.pack("<I", len(text)) + text + picture.jpeg()


def pixel_answer(picture: Picture, x: float, y: float) -> dict[str, Any]:
    """The values of a picture at a place, in fractions of its size from the top left."""
    layers, (width, height) = picture.layers(), picture.size
    column, row = (min(count - 1, max(0, int(at * count))) for at, count in ((x, width), (y, height)))
    values = {
        name: dict(
            zip(picture.channels(name), (each.item() for each in layers[name][row, column]), strict=True)
        )
        for name in layers
    }
    return {"type": "pixel", "x": column, "y": row, "layers": values, **_surface(picture.window, values)}


def _surface(window: Window, values: Mapping[str, Mapping[str, Any]]) -> dict[str, str | None]:
    """The object at a pixel and its material; None where there is none, or the mesh file decides."""
    number = int(values.get("object_id", {"Y": 0})["Y"])
    if number == 0:
        return {"object": None, "material": None}
    scene = window.now.scene
    thing = scene.objects[number - 1]
    material = thing.material if isinstance(thing.material, str) else None
    return {"object": scene.object_names()[number - 1], "material": material}
