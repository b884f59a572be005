"""Restrictions of a scene under which both ways of a relation must agree."""

from __future__ import annotations

import copy
from random import Random
from typing import Any

from metamorphic import scenes, surfaces
from metamorphic.pictures import ALL
from metamorphic.scenes import Case

SEEN = tuple(name for name in ALL if name != "shadows")
"""Without shadows: those of surfaces that face away from the light are their own, and rounding decides."""


UNDRAWN = tuple(name for name in SEEN if name != "obscurance")
"""The layers that draw no random number where a scene has no obscurance and one sample per pixel."""


UNCUT = tuple(name for name in UNDRAWN if name != "uv")
"""Those that do not depend on how planar polygons are cut into triangles."""


def at_centres(case: Case) -> Case:
    """One sample per pixel, through its centre."""
    case = fixed_samples(case)
    case.scene["film"] |= {"samples": 1}
    for camera in case.scene["cameras"].values():
        camera.pop("samples", None)
    return case


def fixed_samples(case: Case) -> Case:
    """Every pixel gets all samples."""
    case = case.copy()
    case.scene["film"]["adaptive"] = False
    return case


def without_rays(case: Case) -> Case:
    """No obscurance: nothing is drawn at random but the samples of pixels."""
    case = case.copy()
    case.scene.pop("obscurance", None)
    return case


def from_polygons(case: Case) -> Case:
    """Shadows begin on the polygons, whatever surface their normals imply."""
    case = case.copy()
    case.scene["terminator"] = "none"
    return case


def with_own_meshes(case: Case) -> Case:
    """Each object has a mesh of its own, from another file or of another name: none is an instance."""
    case = case.copy()
    for k, thing in enumerate(case.scene["objects"]):
        source = copy.deepcopy(case.scene["meshes"][thing["mesh"]])
        if "file" in source:
            old, name = source["file"], f"own{k}.{source['file'].partition('.')[2]}"
            case.meshes[name], source["file"] = case.meshes[old], name
        case.scene["meshes"][f"own{k}"] = source
        thing["mesh"] = f"own{k}"
    return case


def one_camera(case: Case) -> Case:
    """The first camera alone."""
    case = case.copy()
    name, camera = next(iter(case.scene["cameras"].items()))
    case.scene["cameras"] = {name: camera}
    return case


def grained(case: Case) -> Case:
    """Every object has a grain of its own: without, and without uv, it follows the scene's axes."""
    case = case.copy()
    for thing in case.scene["objects"]:
        thing.setdefault("grain", [1, 0.2, 0])
    return case


def within_reach(case: Case, reach: float) -> Case:
    """Occluders count up to this distance at most [scene units]."""
    case = case.copy()
    settings = case.scene.setdefault("obscurance", {"samples": 8, "falloff": {"falloff": "step"}})
    settings["falloff"]["max_distance"] = reach
    return case


def framed(case: Case) -> Case:
    """Two specks far away hold the scene's centre and radius, whatever else stands inside."""
    case = case.copy()
    specks = [
        [s * 9 + x, s * 9 + y, s * 9.0] for s in (-1, 1) for x, y in ((0, 0), (s * -1e-3, 0), (0, s * -1e-3))
    ]
    mesh = {"shape": "polygons", "vertices": specks, "faces": [[0, 1, 2], [3, 4, 5]]}
    case.scene["objects"] = [*case.scene["objects"], {"name": "specks", "mesh": mesh}]
    return case


def files_alone(case: Case, random: Random, of: Any = surfaces.SURFACES, own: bool = True) -> Case:
    """Every mesh a file, with normals of its own where `own`."""
    case = case.copy()
    case.meshes.clear()
    for name in case.scene["meshes"]:
        source = scenes.mesh_file(random, case, of)
        file = source["file"]
        while own and (case.meshes[file].normals is None or file.endswith("stl")):
            del case.meshes[file]
            source = scenes.mesh_file(random, case, of)
            file = source["file"]
        if own:
            source.pop("normals", None)
        case.scene["meshes"][name] = source
    for thing in case.scene["objects"]:
        plain_material(random, thing)
        if random.random() < 0.4:
            scenes.vary(random, case, thing)
    return case


def without_images(case: Case, random: Random) -> Case:
    """No texture: uv are linear over triangles, not over polygons."""
    case = case.copy()
    for thing in case.scene["objects"]:
        if any(
            isinstance(value, dict) and "texture" in value for value in thing.get("override", {}).values()
        ):
            plain_material(random, thing)
    return case


def plain_material(random: Random, thing: dict[str, Any], grained: bool = True) -> None:
    """Give an object a material of its own that does not vary over the surface."""
    names = [name for name in scenes.SMALL if grained or name not in scenes.GRAINED]
    model = random.choice(names)
    thing.pop("override", None)
    thing["material"] = {"model": model, **scenes.MODELS[model](random)}


def drawn_mesh(case: Case, random: Random) -> str:
    """The name of a mesh that some object has."""
    return random.choice([thing["mesh"] for thing in case.scene["objects"]])
