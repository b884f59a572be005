"""Reads the scene and the meshes of a bake."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from illumcli.baking.points import Surfaces
from illumcli.geometry.repairs import Repairs
from illumcli.geometry.scene_geometry import SceneGeometry, corner_normals
from illumcli.mesh_files import is_mesh_file
from illumcli.render_graph.build import build
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene


def input_of(path: Path, overrides: Sequence[str] = ()) -> SceneFile:
    """A scene, or the scene of a mesh file alone."""
    return mesh_alone(path, overrides) if is_mesh_file(path) else load(path, overrides)


def mesh_alone(path: Path, overrides: Sequence[str] = ()) -> SceneFile:
    """A scene of one mesh file alone, without a transform or a floor."""
    scene_file = load(path, overrides)
    description = {"version": 1, "objects": [{"mesh": {"file": path.name}, "name": "mesh"}]}
    return replace(scene_file, scene=Scene.model_validate(description))


def surfaces_of(scene: Scene, loaded: SceneFile) -> tuple[Surfaces, Repairs]:
    """The placed meshes of a scene, as in a render, with the normals that are the axes of hemispheres; and
    their repairs."""
    buffers = _buffers_of(scene, loaded, "geometry", "corner_normals", "repairs")
    geometry, normals = buffers["geometry"], buffers["corner_normals"]
    if scene.obscurance is not None and scene.obscurance.about == "geometric":
        normals = corner_normals(("flat",) * len(geometry.placed), geometry)
    return Surfaces(geometry, normals), buffers["repairs"].repairs


def geometry_of(loaded: SceneFile) -> SceneGeometry:
    """The placed meshes of a scene."""
    geometry: SceneGeometry = _buffers_of(loaded.scene, loaded, "geometry")["geometry"]
    return geometry


def _buffers_of(scene: Scene, loaded: SceneFile, *names: str) -> dict[str, Any]:
    buffers: dict[str, Any] = {}
    for node in build(scene, loaded, shares_meshes=False).topological_order(list(names)):
        buffers[node.output] = node.run(buffers)
    return buffers
