"""The input of a bake: a single mesh file or a scene, placed and hashed before any ray is cast."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.baking.context import StageClock
from illumcli.baking.files import ASSETS, baked_contents
from illumcli.baking.loading import geometry_of, input_of, surfaces_of
from illumcli.baking.occluder_choice import occluding_files
from illumcli.baking.occluders import OccludingMesh
from illumcli.baking.points import Surfaces
from illumcli.baking.refusals import (
    refuse_color,
    refuse_inputs,
    refuse_lost_colors,
    refuse_missing_uv,
    refuse_outputs,
    refuse_textures,
)
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
from illumcli.cache.fingerprint import FileFingerprint, digest
from illumcli.errors import InputError
from illumcli.files.claims import claim_path
from illumcli.files.names import fields
from illumcli.files.outputs import is_kept
from illumcli.geometry.repairs import Repairs
from illumcli.mesh_files import companions, is_mesh_file
from illumcli.mesh_files.gltf.extend import copyable
from illumcli.records import Record
from illumcli.render_graph.costs import BYTES
from illumcli.render_graph.limits import expected_memory
from illumcli.render_graph.repairs import refuse_repairs
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
