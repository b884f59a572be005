"""Node functions that combine folders which do not import each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors
from illumcli.cache.fingerprint import FileFingerprint
from illumcli.errors import InputError
from illumcli.film.tiles import Samples
from illumcli.film.view import View, distance
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.mesh_checks import faults
from illumcli.geometry.repairs import Repair, Repairs, note
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.rays import sampling
from illumcli.rays.corner_weights import CornerWeights
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.records import Record, Value
from illumcli.render_space import RenderSpace
from illumcli.scene.spec import DepthCue
from illumcli.shading.materials import Materials, Numbering, Token, materials, textures_at

# --- once: contents of files -----------------------------------------------------------------------------


def mesh(source: Any) -> Mesh:
    """The mesh of a file, given by its `FileFingerprint`, or of a shape.

    Raises
    ------
    InputError
        The file changed while it was read.
    """
    if not isinstance(source, FileFingerprint):
        shape: Mesh = source.mesh()
        return replace(shape, repairs=faults(shape))
    from illumcli.mesh_files import read_mesh

    from_file = read_mesh(source.path)
    if source.has_changed:
        raise InputError(f"{source.path}: changed while it was read; run again once it is whole")

    # A mesh is cached by its content: paths of textures become relative to its folder, wherever that is.
    folder = source.path.parent
    libraries = {
        name: textures_at(keys, lambda path: str(Path(path).relative_to(folder)))
        for name, keys in from_file.materials.items()
    }
    return replace(from_file, materials=libraries)


def meshes(which: tuple[int, ...], **parts: Mesh) -> tuple[Mesh, ...]:
    """The mesh of every object; `which` holds the number of each object's mesh among `parts`."""
    sources = list(parts.values())
    return tuple(sources[k] for k in which)


def render_space(object_bounds: ObjectBounds) -> RenderSpace:
    """The scene's centre and radius."""
    return object_bounds.render_space


class BakedValues(Record):
    """Baked obscurance at the scene's corners."""

    values: CornerVectors  # (C, 1) NaN on meshes without baked values
    repairs: Repairs


def baked(files: tuple[tuple[str, FileFingerprint | None], ...], geometry: SceneGeometry) -> BakedValues:
    """The baked values of each object: at corners if its file has them, otherwise at vertices.

    Raises
    ------
    InputError
        A file with values for another number of vertices.
    """
    from illumcli.visibility.baked import mesh_hash, read_npz

    values = np.full((sum(len(placed.mesh.corners) for placed in geometry.placed), 1), np.nan, F)
    repairs: dict[str, Repair] = {}
    for (name, file), placed in zip(files, geometry.placed, strict=True):
        if file is None:
            continue
        mesh, in_file = placed.mesh, read_npz(file.path)
        at_corners = in_file.of_corners(name, mesh.corners, len(mesh.vertices))
        if at_corners is None:
            raise InputError(
                f"{file.path}: holds {len(in_file.obscurance)} values, the mesh of {name} has "
                f"{len(mesh.vertices)} vertices; bake it again"
            )
        if mesh_hash(mesh.vertices, mesh.corners, mesh.starts) not in in_file.hashes():
            note(repairs, "values that were baked for another mesh of as many vertices", str(file.path))
        values[placed.first_corner : placed.first_corner + len(at_corners), 0] = at_corners
    return BakedValues(CornerVectors(values, np.arange(len(values), dtype=np.int32)), repairs)


def materials_of(
    models: Mapping[Token, Any],
    measured: Mapping[str, FileFingerprint],
    imported: tuple[str | None, ...],
    numbering: Numbering,
    meshes: tuple[Mesh, ...] = (),
) -> Materials:
    """The materials by number, with the paths of measured ones resolved.

    `meshes` are given if materials of mesh files are imported.
    """
    resolved = {
        token: model.at({"file": str(measured[model.file].path)}) if hasattr(model, "file") else model
        for token, model in models.items()
    }
    libraries = {name: mesh for name, mesh in zip(imported, meshes, strict=False) if name}
    return materials(numbering, resolved, libraries)


class Images(Value):
    """Reads the textures of a scene, each once."""

    contents: Mapping[str, FileFingerprint]
    """The textures that the scene itself names, by path."""
    loaded: Any = field(repr=False)
    known: dict[Any, NDArray[np.float32]] = field(default_factory=dict, repr=False)

    def __call__(self, path: str, space: Any) -> NDArray[np.float32]:
        """(H, W, C) linear image of a texture of the scene, or of a mesh file's library."""
        if (path, space) not in self.known:
            self.known[path, space] = self._read(path, space)
        return self.known[path, space]

    def _read(self, path: str, space: Any) -> NDArray[np.float32]:
        from illumcli.images.reader import read_embedded_texture, read_texture
        from illumcli.mesh_files import embedded_image, image_within
        from illumcli.scene.access import resolve

        if path in self.contents:
            return read_texture(self.contents[path].path, space)
        if (within := image_within(path)) is None:
            return read_texture(resolve(self.loaded, path), space)
        file, number = within
        data = embedded_image(resolve(self.loaded, file), number)
        return read_embedded_texture(data, f"{file}: images[{number}]", space)


# --- per tile ---------------------------------------------------------------------------------------------


def alpha(hits: Hits) -> Floats:
    """(M,) 1 at every hit."""
    return np.ones(len(hits.sample), F)


def no_shadow(hits: Hits) -> Floats:
    """(M,) delta of a light that casts no shadow."""
    return np.ones(len(hits.sample), F)


def obscurance_draws(seed: int, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): rotation and phase of each hit's obscurance rays."""
    key = sampling.stream(seed, "obscurance")
    pixel = hits.sample // samples.per_pixel
    sample = hits.sample - pixel * samples.per_pixel
    return sampling.dither(key, samples.x.take(pixel), samples.y.take(pixel), sample + (samples.first or 0))


def baked_obscurance(geometry: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) baked values interpolated over polygons; NaN on meshes without baked values."""
    w: Floats = corner_weights.interpolate(geometry, baked.values)[:, 0]
    return w


def depth_cued(
    cue: DepthCue, view: View, render_space: RenderSpace, interaction: SurfaceInteraction, uncued: Vectors
) -> Vectors:
    """(M, 3) radiance blended into the cue's colour with the distance from the eye."""
    depth = (distance(view, render_space, interaction) - cue.near) / (cue.far - cue.near)
    fade = (cue.strength * np.clip(depth, 0, 1)).astype(F)[:, None]
    return (1 - fade) * uncued + fade * np.asarray(cue.color, F)
