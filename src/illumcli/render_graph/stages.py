"""Node functions that combine folders which do not import each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors
from illumcli.cache.fingerprint import FileFingerprint
from illumcli.errors import InputError
from illumcli.film.tiles import Samples, Tile
from illumcli.film.view import View, distance
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.mesh_checks import faults
from illumcli.geometry.repairs import Repair, joined, note
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.geometry.shapes import Shape
from illumcli.images.drawings import read_numbers
from illumcli.rays import sampling
from illumcli.rays.embree import Tracer
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.render_space import RenderSpace
from illumcli.scene.spec import DepthCue
from illumcli.shading.materials import Materials, Numbering, Token, materials, origin, textures_at
from illumcli.shading.textures import Varying, texel_positions
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.obscurance import Method
from illumcli.visibility.obscurance import obscurance as traced

MAX_RAYS = 1 << 16
"""Obscurance rays of one sample, at most."""

# --- once: contents of files -----------------------------------------------------------------------------


def mesh(source: FileFingerprint | Shape) -> Mesh:
    """The mesh of a file, given by its `FileFingerprint`, or of a shape.

    Raises
    ------
    InputError
        The file changed while it was read.
    """
    if not isinstance(source, FileFingerprint):
        shape = source.mesh()
        return replace(shape, repairs=faults(shape))
    from illumcli.mesh_files import read_mesh

    from_file = read_mesh(source.path)
    if source.has_changed:
        raise InputError(f"{source.path}: changed while it was read; run again once it is whole")

    # A mesh is cached by its content: paths of textures become relative to its folder, wherever that is.
    folder = source.path.parent
    libraries, occlusion = (
        {
            name: textures_at(keys, lambda path: str(Path(path).relative_to(folder)))
            for name, keys in described.items()
        }
        for described in (from_file.materials, from_file.occlusion)
    )
    return replace(from_file, materials=libraries, occlusion=occlusion)


def meshes(which: tuple[int, ...], **parts: Mesh) -> tuple[Mesh, ...]:
    """The mesh of every object; `which` holds the number of each object's mesh among `parts`."""
    sources = list(parts.values())
    return tuple(sources[k] for k in which)


def obscurance_meshes(which: tuple[int | None, ...], **parts: Mesh) -> tuple[Mesh | None, ...]:
    """The mesh in the file of every object's obscurance, if that is a mesh file; see `meshes`."""
    sources = list(parts.values())
    return tuple(None if k is None else sources[k] for k in which)


def render_space(object_bounds: ObjectBounds) -> RenderSpace:
    """The scene's centre and radius."""
    return object_bounds.render_space


def materials_of(
    models: Mapping[Token, Any],
    measured: Mapping[str, FileFingerprint],
    imported: tuple[str | None, ...],
    numbering: Numbering,
    meshes: tuple[Mesh, ...] = (),
) -> Materials:
    """The materials by number; those that are used have the paths of their files resolved and are prepared.

    `meshes` are given if materials of mesh files are imported.

    Raises
    ------
    InputError
        Files that models cannot use; all of them.
    """
    used = {origin(token) for token in numbering.tokens}
    known: dict[Token, Any] = {}
    repairs: dict[str, Repair] = {}
    problems: list[str] = []
    for token, model in models.items():
        if token not in used:
            continue
        paths = {path: str(measured[file].path) for path, file in model.files().items()}
        try:
            known[token] = model.at(paths).prepared(read_numbers)
        except InputError as error:
            problems += [f"material {token[-1]}: {problem}" for problem in error.problems]
            continue
        for what, count in known[token].repairs().items():
            note(repairs, what, f"material {token[-1]}", count)
    if problems:
        raise InputError(problems)
    libraries = {name: mesh for name, mesh in zip(imported, meshes, strict=False) if name}
    result = materials(numbering, known, libraries)
    return replace(result, repairs=joined([result.repairs, repairs]))


# --- per tile ---------------------------------------------------------------------------------------------


def alpha(hits: Hits) -> Floats:
    """(M,) 1 at every hit."""
    return np.ones(len(hits.sample), F)


def no_shadow(hits: Hits) -> Floats:
    """(M,) delta of a light that casts no shadow."""
    return np.ones(len(hits.sample), F)


def ray_order(tile: Tile, samples: Samples, hits: Hits) -> NDArray[np.intp]:
    """(M,) hits in the order in which shadow rays are cast: those of neighbouring pixels in one packet."""
    order, each = tile.in_blocks(), samples.per_pixel
    if each > 1:
        order = (order[:, None] * each + np.arange(each)).ravel()
    if len(hits.sample) == len(order):
        return order
    hit = np.full(len(order), -1, np.intp)
    hit[hits.sample] = np.arange(len(hits.sample))
    hit = hit.take(order)
    return hit.compress(hit >= 0)


def obscurance_draws(seed: int, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): rotation and phase of each hit's obscurance rays."""
    key = sampling.stream(seed, "obscurance")
    pixel = hits.sample // samples.per_pixel
    sample = hits.sample - pixel * samples.per_pixel
    return sampling.dither(key, samples.x.take(pixel), samples.y.take(pixel), sample)


def view_method(obscurance_method: Method, view: View) -> Method:
    """The method of one sample, which casts the rays of all samples that it represents."""
    return replace(obscurance_method, samples=min(obscurance_method.samples * view.stands_for, MAX_RAYS))


def read_hits(hits: Hits, view: View, read_pixels: NDArray[np.bool_] | None) -> NDArray[np.int64] | None:
    """(K,) the hits whose obscurance is read; None if it is all of them.

    Parameters
    ----------
    read_pixels : (P,) bool, optional
        Pixels whose obscurance is read.
    """
    return None if read_pixels is None else np.flatnonzero(read_pixels.take(hits.sample // view.samples))


def obscurance(
    tracer: Tracer,
    hemispheres: Hemispheres,
    obscurance_draws: NDArray[np.float64],
    view_method: Method,
    read_hits: NDArray[np.int64] | None,
    baked_obscurance: Floats | None = None,
) -> NDArray[np.float32]:
    """(M,) w of every hit; NaN at those whose w is not read."""
    if read_hits is None:
        return traced(tracer, hemispheres, obscurance_draws, view_method, baked_obscurance)
    w = np.full(len(hemispheres.n), np.nan, F)
    baked = None if baked_obscurance is None else baked_obscurance.take(read_hits)
    draws = obscurance_draws[:, read_hits]
    w[read_hits] = traced(tracer, hemispheres.take(read_hits), draws, view_method, baked)
    return w


def texels(
    geometry: SceneGeometry,
    uvs: CornerVectors,
    hits: Hits,
    material_id: NDArray[np.uint32],
    **textures: Varying,
) -> NDArray[np.float32]:
    """(M, 2) place of every hit in the largest texture of its material [texels]."""
    return texel_positions(geometry, uvs, hits, material_id.astype(np.int32) - 1, tuple(textures.values()))


def depth_cued(
    cue: DepthCue, view: View, render_space: RenderSpace, interaction: SurfaceInteraction, uncued: Vectors
) -> Vectors:
    """(M, 3) radiance blended into the cue's colour with the distance from the eye."""
    depth = (distance(view, render_space, interaction) - cue.near) / (cue.far - cue.near)
    fade = (cue.strength * np.clip(depth, 0, 1)).astype(F)[:, None]
    return (1 - fade) * uncued + fade * np.asarray(cue.color, F)
