"""The scene that `illum render MESH` shows a mesh in, adapted to the requested view.

The azimuth is an angle about the up axis in degrees: 0 looks at the front, the side of +z if y is up (of -y
if z is up), 90 at the side of +x. The elevation is 0 at the horizon and 90 straight above.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2, cos, radians, sin
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, Strict

from illumcli.scene.override import Override, assign
from illumcli.scene.source import Node, Place, Problem
from illumcli.schema.description import DEFAULTS, Description

STUDIO = Path(__file__).with_name("studio.yaml")
SETTINGS = "studio"
"""First step of overrides of the fields of `Studio`: `-D studio.view=[90,10]`."""

Azimuth: TypeAlias = Annotated[float, Field(ge=-360, le=360)]
Elevation: TypeAlias = Annotated[float, Field(ge=-90, le=90)]
Up: TypeAlias = Literal["x", "y", "z", "-x", "-y", "-z"]


class Studio(Description):
    """How the studio shows its mesh."""

    view: Annotated[tuple[Azimuth, Elevation], Strict(False)] | None = None
    """Azimuth and elevation [degrees]; by default those of the studio's camera, about 24 and 13."""
    up: Up = "y"
    """The axis of the mesh's file that points up."""


class Settings(Description):
    """What overrides may set in addition to the scene."""

    studio: Studio = DEFAULTS


ROTATIONS: Mapping[str, tuple[float, float, float]] = {
    "x": (0, 0, 90),
    "y": (0, 0, 0),
    "z": (-90, 0, 0),
    "-x": (0, 0, -90),
    "-y": (180, 0, 0),
    "-z": (90, 0, 0),
}
"""Rotation of a mesh that turns each axis upwards: degrees about x, then y, then z."""


def arranged(tree: Node, studio: Studio) -> Node:
    """The studio's scene for the view and the mesh's up axis.

    The lights turn about the up axis with the camera. The floor is removed if the camera is below it.
    """
    # The changes by path, as overrides; None removes a part.
    changes: dict[str, Sequence[float] | None] = {}
    if studio.up != "y":
        changes["objects.subject.transform.rotate"] = ROTATIONS[studio.up]
    if studio.view is not None:
        azimuth, elevation = map(radians, studio.view)
        x, _, z = _numbers(tree, ("camera", "position"))
        changes["camera.position"] = (
            sin(azimuth) * cos(elevation),
            sin(elevation),
            cos(azimuth) * cos(elevation),
        )
        # An up vector perpendicular to the line of sight is valid at any elevation.
        changes["camera.up"] = (
            -sin(azimuth) * sin(elevation),
            cos(elevation),
            -cos(azimuth) * sin(elevation),
        )
        turn = azimuth - atan2(x, z)
        for number in range(len(_parts(tree, "lights"))):
            position = _numbers(tree, ("lights", number, "position"))
            changes[f"lights.{number}.position"] = _turned(position, turn)
        if elevation < 0:
            changes["objects.floor"] = None

    # Apply them.
    problems: list[Problem] = []
    for path, numbers in changes.items():
        at = Place(str(STUDIO))
        value = Node(None if numbers is None else [Node(float(each), at) for each in numbers], at)
        tree = assign(tree, Override(tuple(path.split(".")), value, path), problems) or tree
    return tree


def _numbers(tree: Node, path: tuple[str | int, ...]) -> tuple[float, float, float]:
    node = tree.find(path)
    assert node is not None
    x, y, z = node.plain()
    return x, y, z


def _parts(tree: Node, name: str) -> list[Node]:
    node = tree.find((name,))
    assert node is not None
    assert isinstance(node.value, list)
    return node.value


def _turned(position: tuple[float, float, float], angle: float) -> tuple[float, float, float]:
    """The position rotated about the y axis, from z towards x."""
    x, y, z = position
    return x * cos(angle) + z * sin(angle), y, z * cos(angle) - x * sin(angle)
