"""What a scene asks of its render graph: its views and layers, and what can be left out of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from illumcli.errors import InputError
from illumcli.film.view import View
from illumcli.layers import FIXED, PER_LIGHT, Layer
from illumcli.lights._base import Light
from illumcli.models._base import IlluminationModel
from illumcli.scene.spec import MeshFile, Scene, default_material
from illumcli.schema.messages import suggestion
from illumcli.shading.rates import RATES, Rate
from illumcli.shading.terms import given_terms
from illumcli.shading.textures import paths


def views(scene: Scene) -> list[View]:
    """The scene's cameras with their films."""
    film = scene.film
    return [
        View(
            name,
            camera,
            camera.width or film.width,
            camera.height or film.height,
            camera.samples or film.samples,
            film.adaptive,
        )
        for name, camera in scene.named_cameras().items()
    ]


def layers(scene: Scene, names: Sequence[str]) -> list[Layer]:
    """The layers of these names: `lights` and `shadows` stand for one per light, which can be named alone.

    Raises
    ------
    InputError
        A name that is no layer of this scene.
    """
    per_light = {name: [row.of(light) for light in scene.named_lights()] for name, row in PER_LIGHT.items()}
    layers_of_lights = [layer for layers in per_light.values() for layer in layers]
    known = {layer.name: [layer] for layer in [*layers_of_lights, *FIXED.values()]} | per_light
    problems = [f"no layer '{name}'; {suggestion(name, tuple(known))}" for name in names if name not in known]
    if problems:
        raise InputError(problems)
    return list({layer.name: layer for name in names for layer in known[name]}.values())


def candidates(scene: Scene) -> list[IlluminationModel] | None:
    """The models that some surface may have; None where a mesh file's own library decides."""
    found: list[IlluminationModel] = []
    for thing in scene.objects:
        model = scene.material_of(thing)
        if model is not None:
            found.append(model)
            continue
        if imports(scene, thing):
            return None
        found += [default_material(), *scene.materials.values()]
    return found


def imports(scene: Scene, thing: Any) -> bool:
    """Does an object have the materials that its mesh file describes?"""
    wants = thing.fallback is not None or getattr(source_of(scene, thing.mesh), "materials", False)
    return thing.material is None and bool(wants)


def reached_words(scene: Scene) -> frozenset[str]:
    """The words (`v`, `t`, ...) that some lobe of some candidate asks for."""
    models = candidates(scene)
    if models is None:  # libraries of meshes describe models that know of no tangent
        models = [*scene.materials.values(), *filter(None, map(scene.material_of, scene.objects))]
        return frozenset(("n", "l", "v")).union(*(given_terms(model.lobes()) for model in models))
    return frozenset().union(*(given_terms(model.lobes()) for model in models))


def rates(scene: Scene) -> list[Rate]:
    """The shading rate of each object."""
    return [thing.shading or scene.shading for thing in scene.objects]


def is_ambient(scene: Scene) -> bool:
    """Does any ambient light leave a surface?"""
    models = candidates(scene)
    if not any(scene.ambient.color):
        return False
    return models is None or any(_glows(model, model.ambient_color()) for model in models)


def weighs_ambient(scene: Scene) -> bool:
    """Is the ambient light weighed by obscurance, traced or baked?"""
    return scene.obscurance is not None or any(is_baked(scene))


def is_emissive(scene: Scene) -> bool:
    """Does any surface emit light?"""
    models = candidates(scene)
    return models is None or any(_glows(model, model.emission) for model in models)


def _glows(model: IlluminationModel, color: Any) -> bool:
    return not isinstance(color, tuple) or any(color)


def may_vary(scene: Scene, purpose: str) -> bool:
    """May a parameter that serves `purpose` (`lobes`, `ambient`, `emission`) vary over some surface?"""
    models = candidates(scene)
    return models is None or any(paths(model, purpose) for model in models)


def sends(light: Light) -> bool:
    """Does a light send anything?"""
    return any(light.color())


def active_lights(scene: Scene) -> dict[str, Light]:
    """The lights that send anything, by name."""
    return {name: light for name, light in scene.named_lights().items() if sends(light)}


def is_baked(scene: Scene) -> list[bool]:
    """Of each object: does its mesh name baked obscurance?"""
    return [getattr(source_of(scene, thing.mesh), "obscurance", None) is not None for thing in scene.objects]


def all_baked(scene: Scene) -> bool:
    """Is there no surface left to cast obscurance rays from?"""
    return bool(scene.objects) and all(is_baked(scene))


def source_of(scene: Scene, mesh: Any) -> Any:
    """The description of an object's mesh."""
    if isinstance(mesh, str):
        return scene.meshes[mesh] if mesh in scene.meshes else MeshFile(file=mesh)
    return mesh


def mesh_name(scene: Scene, mesh: Any) -> str:
    """What an object's mesh is called: by its file, else by its name, else by its description."""
    source = source_of(scene, mesh)
    if isinstance(source, MeshFile):
        return source.file if "." in source.file else f"./{source.file}"  # apart from names
    return mesh if isinstance(mesh, str) else repr(source)


def is_smooth(scene: Scene) -> bool:
    """Is some object shaded with the normals at its corners?"""
    return any(RATES[rate].is_smooth for rate in rates(scene))
