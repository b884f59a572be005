"""Nodes of materials: their numbers, their models, and the parameters that vary over surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

from illumcli.cache.fingerprint import FileFingerprints
from illumcli.graph import Node
from illumcli.images.textures import Images
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import Texture, maps_of
from illumcli.render_graph import needs, stages
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Object, Scene, default_material
from illumcli.shading.ambient import ambient_color, emission
from illumcli.shading.materials import DEFAULT, Choice, Token, numbering
from illumcli.shading.textures import PointMaterials, parameters, textures

PURPOSES = ("lobes", "ambient", "emission")
"""What parameters that vary over a surface are used for."""


def material_nodes(scene: Scene, loaded: SceneFile, files: FileFingerprints) -> list[Node]:
    """Nodes of the material numbers, the models, and the parameters that vary."""
    # How each object's materials are chosen, and all models that may be.
    choices: list[Choice] = []
    models: dict[Token, Any] = {}
    for thing, name in zip(scene.objects, scene.object_names(), strict=True):
        choice, chosen = _choice(scene, thing, name)
        choices.append(choice)
        models |= chosen
    imported = tuple(choice.library for choice in choices)
    if any(choice.own is None for choice in choices):  # a mesh may select any material of the scene, or none
        models |= {("material", name): model for name, model in scene.materials.items()}
        models[DEFAULT] = default_material()

    # Measured materials and textures are identified by the content of their files.
    tables = {file for model in models.values() for file in model.files().values()}
    measured = {path: files.of(path, partial(resolve, loaded)) for path in sorted(tables)}
    named = sorted({each.texture for each in _varied(models.values()) if isinstance(each, Texture)})
    contents = {path: files.of(path, partial(resolve, loaded)) for path in named}
    images = Images(contents, partial(resolve, loaded))

    libraries = {"meshes": "meshes"} if any(imported) else {}
    nodes = [
        Node.of(partial(numbering, tuple(choices), tuple(sorted(scene.materials))), "numbering"),
        Node.of(partial(stages.materials_of, models, measured, imported), "materials", **libraries),
        Node.of(ambient_color, materials="ambient_materials"),
        Node.of(emission, materials="emission_materials"),
    ]
    for purpose in PURPOSES:
        vary = {}
        if needs.may_vary(scene, purpose):
            read, at_points = f"{purpose}_textures", f"{purpose}_parameters"
            vary = {"parameters": at_points}
            nodes += [
                Node.of(partial(textures, scene.object_names(), images, purpose), read),
                Node.of(parameters, at_points, textures=read),
            ]
        nodes.append(Node.of(PointMaterials, f"{purpose}_materials", number="material", **vary))
    return nodes


def _choice(scene: Scene, thing: Object, name: str) -> tuple[Choice, dict[Token, IlluminationModel]]:
    """How the materials of an object are chosen, and the models of the object itself."""
    models: dict[Token, IlluminationModel] = {}
    of_scene = isinstance(thing.material, str) and not thing.override
    token: Token | None = ("material", str(thing.material)) if of_scene else ("object", name)
    model = scene.material_of(thing)
    if model is None:
        token = None
    elif token is not None:
        models[token] = model
    fallback: Token | None = None
    if (other := scene.fallback_of(thing)) is not None:
        fallback = ("material", thing.fallback) if isinstance(thing.fallback, str) else ("fallback", name)
        models[fallback] = other
    library = needs.mesh_name(scene, thing.mesh) if needs.imports(scene, thing) else None
    return Choice(token, library, fallback), models


def _varied(models: Iterable[IlluminationModel]) -> list[Any]:
    """The textures and vertex values of all models."""
    return [each for model in models for value in model.varying().values() for each in maps_of(value)]
