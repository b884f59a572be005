"""What a scene needs from its render graph: views and layers, and properties that let nodes be left out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from illumcli.errors import InputError
from illumcli.film.view import Adaptive, View
from illumcli.geometry.shapes import Shape
from illumcli.layers import FIXED, PER_LIGHT, Layer
from illumcli.lights._base import Light
from illumcli.models._base import IlluminationModel
from illumcli.rays.camera import footprint
from illumcli.scene.spec import MeshFile, NameOrMesh, Object, Scene, default_material
from illumcli.schema.messages import suggestion
from illumcli.shading.rates import RATES, Rate
from illumcli.shading.terms import given_terms
from illumcli.shading.textures import paths

PROBE_SHARE = 4
"""One in so many samples has its first hit tested by adaptive sampling."""
FEWEST_ADAPTIVE = 8
"""Samples per pixel from which on sampling is adaptive by default: of fewer it saves little, unless
obscurance is reconstructed, where a sample costs much more than its rays."""


def views(scene: Scene) -> list[View]:
    """The scene's cameras with their films."""
    cameras = []
    for name, camera in scene.named_cameras().items():
        width, height, count = scene.film_of(name)
        cameras.append(View(name, camera, width, height, count, adaptive(scene, count)))
    return cameras


def adaptive(scene: Scene, samples: int) -> Adaptive | None:
    """How adaptive sampling finds the pixels that one sample is not enough for; None if all get all."""
    settings = scene.film.adaptive
    by_default = samples >= FEWEST_ADAPTIVE or reconstructs(scene)
    if samples == 1 or settings is False or (settings is None and not by_default):
        return None
    probes = (settings.probes if settings else None) or max(1, samples // PROBE_SHARE)
    reach, spread = footprint(scene.film.filter)
    return Adaptive(min(probes, samples), reach, spread)


def layers(scene: Scene, names: Sequence[str]) -> list[Layer]:
    """The layers of these names; `lights` and `shadows` expand to one per light, which has its own name, too.

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
    """The models that some surface may have; None if a mesh file's library decides."""
    models: dict[int, IlluminationModel] = {}  # each once, however many objects have it
    by_name = False
    for thing in scene.objects:
        model = scene.material_of(thing)
        if model is not None:
            models[id(model)] = model
        elif imports(scene, thing):
            return None
        else:
            by_name = True
    return [*models.values(), *([default_material(), *scene.materials.values()] if by_name else [])]


def imports(scene: Scene, thing: Object) -> bool:
    """True if an object has the materials of its mesh file."""
    enabled = thing.fallback is not None or getattr(source_of(scene, thing.mesh), "materials", False)
    return thing.material is None and bool(enabled)


def needed_terms(scene: Scene) -> frozenset[str]:
    """The given terms (`v`, `t`, ...) that the lobes of some candidate need."""
    models = candidates(scene)
    if models is None:  # no model of a mesh file's library needs a tangent
        models = [*scene.materials.values(), *filter(None, map(scene.material_of, scene.objects))]
        return frozenset(("n", "l", "v")).union(*(given_terms(model.lobes()) for model in models))
    return frozenset().union(*(given_terms(model.lobes()) for model in models))


def rates(scene: Scene) -> list[Rate]:
    """The shading rate of each object."""
    return [thing.shading or scene.shading for thing in scene.objects]


def is_ambient(scene: Scene) -> bool:
    """True if some surface reflects ambient light."""
    models = candidates(scene)
    if not any(scene.ambient.color):
        return False
    return models is None or any(_glows(model, model.ambient_color()) for model in models)


def weighs_ambient(scene: Scene) -> bool:
    """True if ambient light is multiplied by obscurance, traced or baked."""
    return scene.obscurance is not None or any(is_baked(scene))


def is_emissive(scene: Scene) -> bool:
    """True if some surface emits light."""
    models = candidates(scene)
    return models is None or any(_glows(model, model.emission) for model in models)


def _glows(model: IlluminationModel, color: Any) -> bool:
    return not isinstance(color, tuple) or any(color)


def may_vary(scene: Scene, purpose: str) -> bool:
    """True if a parameter for `purpose` (`lobes`, `ambient`, `emission`) may vary over some surface."""
    models = candidates(scene)
    return models is None or any(paths(model, purpose) for model in models)


def is_on(light: Light) -> bool:
    """True if a light's intensity is not 0."""
    return any(light.color())


def active_lights(scene: Scene) -> dict[str, Light]:
    """The lights whose intensity is not 0, by name."""
    return {name: light for name, light in scene.named_lights().items() if is_on(light)}


def reconstructs(scene: Scene) -> bool:
    """Is w fitted to the surface around each pixel?"""
    return bool(scene.obscurance and scene.obscurance.reconstruct) and not all_baked(scene)


def is_baked(scene: Scene) -> list[bool]:
    """For each object, True if its mesh names a file of baked obscurance."""
    return [getattr(source_of(scene, thing.mesh), "obscurance", None) is not None for thing in scene.objects]


def may_have_occlusion_maps(scene: Scene) -> bool:
    """True if a file of obscurance may have it in textures: all but .npz."""
    return any(not file.lower().endswith(".npz") for file in files_of_obscurance(scene).values())


def files_of_obscurance(scene: Scene) -> dict[str, str]:
    """The file of the obscurance of each object that has one, by the object's name."""
    files = [getattr(source_of(scene, thing.mesh), "obscurance", None) for thing in scene.objects]
    return {name: file for name, file in zip(scene.object_names(), files, strict=True) if file is not None}


def all_baked(scene: Scene) -> bool:
    """True if no object needs obscurance rays."""
    return bool(scene.objects) and all(is_baked(scene))


def source_of(scene: Scene, mesh: NameOrMesh) -> MeshFile | Shape:
    """The description of an object's mesh."""
    if isinstance(mesh, str):
        return scene.meshes[mesh] if mesh in scene.meshes else _mesh_file(mesh)
    return mesh


@lru_cache(maxsize=1 << 16)
def _mesh_file(path: str) -> MeshFile:
    """The description of a mesh that is given by its path alone."""
    return MeshFile(file=path)


def mesh_name(scene: Scene, mesh: NameOrMesh) -> str:
    """Name of an object's mesh: its file, otherwise its name in the scene, otherwise its description."""
    source = source_of(scene, mesh)
    if isinstance(source, MeshFile):
        return source.file if "." in source.file else f"./{source.file}"  # never equal to a name
    return mesh if isinstance(mesh, str) else repr(source)


def is_smooth(scene: Scene) -> bool:
    """True if some object is shaded with the normals at its corners."""
    return any(RATES[rate].is_smooth for rate in rates(scene))
