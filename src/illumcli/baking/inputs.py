"""The input of a bake: a single mesh file or a scene, placed and hashed before any ray is cast."""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.atlas.unwrap import refuse_missing_library
from illumcli.baking.context import StageClock
from illumcli.baking.files import ASSETS, SUFFIXES, baked_contents
from illumcli.baking.occluder_choice import occluding_files
from illumcli.baking.occluders import OccludingMesh
from illumcli.baking.points import Surfaces
from illumcli.baking.settings import BakeJob, BakeSettings
from illumcli.baking.texture_limits import refuse_large_textures
from illumcli.baking.texture_slots import (
    FIELDS,
    Slot,
    TextureFile,
    is_texture,
    texture_files,
    texture_slots,
)
from illumcli.baking.texture_slots import SUFFIXES as TEXTURE_SUFFIXES
from illumcli.cache.fingerprint import FileFingerprint, digest
from illumcli.errors import InputError
from illumcli.files.claims import claim_path
from illumcli.files.names import fields
from illumcli.files.outputs import is_kept
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import Repairs
from illumcli.geometry.scene_geometry import SceneGeometry, corner_normals
from illumcli.mesh_files import companions, is_mesh_file
from illumcli.mesh_files.gltf.extend import copyable
from illumcli.records import Record
from illumcli.render_graph.build import build
from illumcli.render_graph.costs import BYTES
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.render_graph.repairs import refuse_repairs
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene
from illumcli.visibility.baked import mesh_hash

VERTEX_BYTES = 500
"""Bytes of expected memory per vertex: 320 to 900 in scanned and modelled meshes."""


class BakeWork(Record):
    """A bake whose meshes have been read: its surfaces, and the files to write."""

    job: BakeJob
    outputs: tuple[Path, ...]
    """The files of the bake."""
    slots: tuple[Slot, ...]
    """The textures of the bake, if it has any."""
    texture_of: Mapping[Path, TextureFile]
    """File of a texture -> what it holds."""
    scene: Scene
    surfaces: Surfaces
    occluding: Mapping[Path, OccludingMesh]
    """What occludes and is not baked, by its file."""
    hashes: tuple[str, ...]
    """Hashes of the meshes."""
    content: str
    """Hash of everything that the values and files depend on."""
    repairs: Repairs
    clock: StageClock

    @property
    def path(self) -> Path:
        """The input."""
        return self.job.path

    @property
    def settings(self) -> BakeSettings:
        """The settings of the bake."""
        return self.job.settings

    def has_textures(self, path: Path) -> bool:
        """True for files that hold textures: a texture, or a GLB if the settings ask for textures."""
        has_glb = self.settings.texture is not None and path.suffix.lower() == ".glb"
        return has_glb or path in self.texture_of

    @property
    def contents(self) -> tuple[str, ...]:
        """The content of each output."""
        return (self.content,) * len(self.outputs)

    @property
    def claim(self) -> Path | None:
        """The path of the claim on this bake; None with `force`, which does it whoever has done it."""
        return None if self.job.options.force else claim_path(self.outputs[0], self.content)

    def due(self) -> tuple[Path, ...]:
        """The outputs to write: those that do not exist with the same content.

        Raises
        ------
        OutputError
            A different file exists and the job has not `force`; a file cannot be written.
        """
        force = self.job.options.force
        return tuple(
            each for each in self.outputs if not is_kept(each, [self.content], baked_contents, force)
        )


def prepare_bake(job: BakeJob) -> BakeWork:
    """Read the meshes of a bake, and refuse what is certain to fail; no ray is cast.

    Raises
    ------
    InputError
        A fault of the input, the settings or the outputs' names.
    OutputError
        A different file exists under the name of an output; an output cannot be written.
    LimitError
        The meshes do not fit into memory.
    """
    # Check the names of the outputs.
    path, outputs, settings, options = job.path, job.outputs, job.settings, job.options
    refuse_outputs(outputs)
    refuse_textures(outputs, settings)
    refuse_color(outputs, settings)
    if settings.split and not any(each.suffix.lower() == ".ply" for each in outputs):
        raise InputError("--split belongs to .ply outputs; .glb is split where it must be, .npz has corners")

    # Load the scene; refuse meshes that do not fit into memory.
    clock = StageClock()
    loaded = input_of(path, options.overrides)
    occluding_inputs = {each: input_of(each) for each in occluding_files(settings.occluders)}
    refuse_inputs([loaded, *occluding_inputs.values()], str(path))

    # Read and hash the meshes, and find the outputs to write.
    surfaces, repairs = surfaces_of(loaded.scene, loaded)
    meshes = [placed.mesh for placed in surfaces.geometry.placed]
    hashes = tuple(mesh_hash(mesh.vertices, mesh.corners, mesh.starts) for mesh in meshes)
    occluding = {each: OccludingMesh.of(geometry_of(of)) for each, of in occluding_inputs.items()}
    content = content_hash(loaded.scene, hashes, surfaces, settings, occluding)
    if is_mesh_file(path) and any(each.suffix.lower() in ASSETS for each in outputs):
        content = digest((content, FileFingerprint(lambda: path, companions)))
    refuse_lost_colors(outputs, meshes, settings)
    if path.suffix.lower() in (".glb", ".gltf") and any(each.suffix.lower() == ".glb" for each in outputs):
        copyable(path)
    if options.strict:
        refuse_repairs(str(path), repairs)
    slots = texture_slots(loaded.scene.object_names(), surfaces.geometry)
    texture_of = texture_files(outputs, slots, settings.what)
    if settings.texture is not None and settings.unwrap is None:
        refuse_missing_uv(str(path), slots, meshes)
    if settings.texture is not None:
        refuse_large_textures(str(path), surfaces.geometry, slots, settings)
    work = BakeWork(
        job,
        with_textures(outputs, texture_of),
        slots,
        texture_of,
        loaded.scene,
        surfaces,
        occluding,
        hashes,
        content,
        repairs,
        clock,
    )
    work.due()
    return work


def bake_files(job: BakeJob) -> tuple[Path, ...]:
    """The files of a bake; its meshes are read only if names of textures depend on them.

    Raises
    ------
    InputError
        A fault of the input or of the names.
    """
    depending = {*FIELDS, "what"}
    if not any(depending & set(fields(str(each))) for each in job.outputs if is_texture(each)):
        return job.outputs
    loaded = input_of(job.path, job.options.overrides)
    slots = texture_slots(loaded.scene.object_names(), geometry_of(loaded))
    return with_textures(job.outputs, texture_files(job.outputs, slots, job.settings.what))


def with_textures(outputs: Sequence[Path], textures: Iterable[Path]) -> tuple[Path, ...]:
    """The files of a bake: the outputs, with files of textures in place of their patterns."""
    return (*(each for each in outputs if not is_texture(each)), *textures)


def bake_cost(job: BakeJob) -> int:
    """The cost of a bake [obscurance rays], from the sizes of its files and the rays per vertex alone.

    A vertex takes about `VERTEX_BYTES` of expected memory; with a target error all inputs count 256 rays.

    Raises
    ------
    InputError
        The scene or mesh cannot be read.
    """
    loaded = input_of(job.path, job.options.overrides)
    expected = expected_memory(loaded, loaded.scene)
    size = expected.get("meshes", 0) + expected.get("shapes", 0)
    return size // BYTES + size * job.settings.samples // VERTEX_BYTES


def refuse_outputs(outputs: Sequence[Path]) -> None:
    """Raise InputError for unknown suffixes and files named twice."""
    known = (*SUFFIXES, *TEXTURE_SUFFIXES)
    problems = [
        f"{each}: no writer for '{each.suffix}' files; use one of {', '.join(known)}"
        for each in outputs
        if each.suffix.lower() not in known
    ]
    if len({os.path.abspath(each) for each in outputs}) < len(outputs):
        problems.append("an output is named twice; give each file once")
    if problems:
        raise InputError(problems)


def refuse_textures(outputs: Sequence[Path], settings: BakeSettings) -> None:
    """Raise InputError for textures without a size, and for a size without textures."""
    files = [each for each in outputs if is_texture(each)]
    if files and settings.texture is None:
        raise InputError(f"{files[0]}: is a texture; give its size, as in --texture 1024")
    if settings.texture is None:
        if settings.unwrap is not None:
            raise InputError("--unwrap makes uv for textures; give their size, as in --texture 1024")
        return
    if settings.unwrap is not None:
        refuse_missing_library()
    assets = [each for each in outputs if each.suffix.lower() == ".glb"]
    if not files and not assets:
        raise InputError("--texture belongs to .png, .exr and .glb outputs; name one with -o")
    if assets and "ao" not in settings.what:
        raise InputError(f"{assets[0]}: the textures of a GLB hold ao; add it to --what")


def refuse_lost_colors(outputs: Sequence[Path], meshes: Sequence[Mesh], settings: BakeSettings) -> None:
    """Raise InputError for an OBJ that has no place for values, because its vertices have colours."""
    files = [each for each in outputs if each.suffix.lower() == ".obj"]
    if files and settings.color is None and any("color" in mesh.attributes for mesh in meshes):
        raise InputError(
            f"{files[0]}: the vertices have colours, which an OBJ would hold in place of values; "
            "choose a channel with --color, or bake to .npz"
        )
    if files and "ao" not in settings.what:
        raise InputError(f"{files[0]}: an OBJ holds ao; add it to --what")


def refuse_color(outputs: Sequence[Path], settings: BakeSettings) -> None:
    """Raise InputError for a change of colours without values, or without files that have colours."""
    if settings.color is None:
        return
    if "ao" not in settings.what:
        raise InputError(f"--color {settings.color}: writes ao; add it to --what")
    if not any(each.suffix.lower() in ASSETS for each in outputs):
        raise InputError(f"--color {settings.color}: belongs to outputs with colours, {', '.join(ASSETS)}")


def refuse_missing_uv(place: str, slots: Sequence[Slot], meshes: Sequence[Mesh]) -> None:
    """Raise InputError for objects that textures are baked of and that have no uv."""
    problems = [
        f"{place}: {slot.object_name} has no uv, which textures need; --unwrap missing makes them"
        for slot in slots
        if meshes[slot.object].uvs is None
    ]
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def refuse_inputs(inputs: Sequence[SceneFile], place: str) -> None:
    """Raise LimitError if meshes do not fit into memory together."""
    total: Counter[str] = Counter()
    for loaded in inputs:
        total.update(expected_memory(loaded, loaded.scene, shares_meshes=False))
    total.pop("textures", None)  # no bake reads them
    refuse_memory(0, 0, 0, total, place)


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


def content_hash(
    scene: Scene,
    hashes: Sequence[str],
    surfaces: Surfaces,
    settings: BakeSettings,
    occluding: Mapping[Path, OccludingMesh],
) -> str:
    """Hash of everything that the values and files of a bake depend on."""
    transforms = [dict(each.transform) for each in scene.objects]
    text = json.dumps(
        [__version__, settings.as_data(), list(hashes), transforms, scene.object_names()], default=str
    )
    digest = hashlib.blake2b(text.encode(), digest_size=16)
    arrays: list[NDArray[Any] | None] = [surfaces.normals.values, surfaces.normals.index]
    arrays += [array for each in occluding.values() for array in (each.vertices, each.triangles)]
    if settings.texture is not None:
        for placed in surfaces.geometry.placed:
            mesh = placed.mesh
            digest.update(repr(mesh.material_names).encode())
            arrays += [mesh.uvs, mesh.corner_uvs, mesh.polygon_materials]
    for array in arrays:
        if array is not None:
            digest.update(np.ascontiguousarray(array.T).data)
    return digest.hexdigest()
