"""The stages that join folders which do not know each other: thin functions from buffers to buffers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.cache.fingerprint import FileFingerprint
from illumcli.errors import InputError
from illumcli.geometry import bounds, planar, scene_geometry
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.mesh_checks import faults
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.repairs import (
    NO_GRAIN,
    NO_MATERIAL,
    NORMALS_OF_FILE,
    NOT_ASKED,
    Repair,
    Repairs,
    joined,
    located,
    note,
)
from illumcli.geometry.scene_geometry import CornerVectors, PolygonCentres, SceneGeometry
from illumcli.geometry.smooth_parts import SmoothParts
from illumcli.geometry.transforms import cofactors, transform_matrix
from illumcli.lights._base import Light
from illumcli.rays import interaction as surface
from illumcli.rays import sampling
from illumcli.rays.camera import axes as camera_axes
from illumcli.rays.camera import camera_rays, film_points, framing
from illumcli.rays.corner_weights import CornerWeights
from illumcli.rays.corner_weights import corner_weights as corner_weights_at
from illumcli.rays.embree import Tracer
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.records import Record, Value
from illumcli.render_space import RenderSpace
from illumcli.scene.spec import DepthCue, Obscurance
from illumcli.shading import direct as shading
from illumcli.shading import rates as shading_rates
from illumcli.shading.ambient import ambient_light
from illumcli.shading.ambient import coupled as coupled_light
from illumcli.shading.materials import Choice, Materials, Numbering, Token, materials, textures_at
from illumcli.shading.materials import numbering as number_materials
from illumcli.shading.rates import Points
from illumcli.shading.textures import Parameters, Varying, surface_colors, varying
from illumcli.shading.textures import parameters as parameters_at
from illumcli.visibility import shadows
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.incident import LitPoints, reaching
from illumcli.visibility.incident import lit as lit_lanes
from illumcli.visibility.obscurance import Method, estimates
from illumcli.visibility.open_hemisphere import OpenTriangles

LARGEST_HORIZON = 1 << 17
"""Vertices up to which it is worth to look for facets with nothing above them."""
WORTH_RAYS = 1 << 11
"""To look for one row of them takes about as long as so many rays."""

# --- once: geometry ---------------------------------------------------------------------------------


def mesh(source: Any) -> Mesh:
    """The mesh in a file, given by its `FileFingerprint`, or of a shape.

    Raises
    ------
    InputError
        The file changed while it was read.
    """
    if not isinstance(source, FileFingerprint):
        shape: Mesh = source.mesh()
        return replace(shape, repairs=faults(shape))
    from illumcli.mesh_files import read_mesh

    made = read_mesh(source.path)
    if source.has_changed:
        raise InputError(f"{source.path}: changed while it was read; run again once it is whole")
    # a mesh is kept by its content: what it names is found again where its folder is then
    folder = source.path.parent
    libraries = {
        name: textures_at(keys, lambda path: str(Path(path).relative_to(folder)))
        for name, keys in made.materials.items()
    }
    return replace(made, materials=libraries)


def meshes(which: tuple[int, ...], **parts: Mesh) -> tuple[Mesh, ...]:
    """The mesh of every object, by the number of its source."""
    own = list(parts.values())
    return tuple(own[k] for k in which)


def standing(transforms: tuple[Any, ...], meshes: tuple[Mesh, ...]) -> ObjectBounds:
    """Where every object stands, and the scene's centre and radius."""
    matrices = [transform_matrix(transform, mesh) for transform, mesh in zip(transforms, meshes, strict=True)]
    return bounds.object_bounds(meshes, matrices)


Placement: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float], float | None]
"""Position, target and, of orthographic cameras, extent."""


def framed(
    camera: Any, aspect: float, number: int, meshes: tuple[Mesh, ...], standing: ObjectBounds
) -> Placement:
    """Where a camera stands whose picture the object of this number fills."""
    mesh = meshes[number]
    points = bounds.take_used(mesh, bounds.transformed_vertices(mesh, standing.matrices[number]))
    made = framing(camera, aspect, points)
    return made.position, made.target, getattr(made, "extent", None)


def implied_widths(
    flat: tuple[bool, ...], meshes: tuple[Mesh, ...], standing: ObjectBounds
) -> NDArray[np.float64]:
    """(O,) the widest polygon of each object whose normals imply another surface [scene units], else 0."""
    sizes = [
        0.0 if own else bounds.widest_polygon(mesh, matrix)
        for own, mesh, matrix in zip(flat, meshes, standing.matrices, strict=True)
    ]
    return np.array(sizes, np.float64)


def left(unseen: tuple[int, ...], meshes: tuple[Mesh, ...]) -> tuple[Mesh, ...]:
    """The meshes, those of objects that nobody sees without their polygons."""
    return tuple(
        scene_geometry.without_polygons(mesh) if number in unseen else mesh
        for number, mesh in enumerate(meshes)
    )


def world(by_file: tuple[bool, ...], meshes: tuple[Mesh, ...], standing: ObjectBounds) -> SceneGeometry:
    """All triangles, placed, recentred and scaled to unit radius; `by_file` says of which objects the
    file's normals are used."""
    return scene_geometry.place_meshes(meshes, standing.matrices, standing.frame, by_file)


def frame(standing: ObjectBounds) -> RenderSpace:
    """The scene's centre and radius."""
    return standing.frame


class MeshRepairs(Value):
    """What was wrong with meshes and put right or left out."""

    repairs: Repairs


def repairs(names: tuple[str, ...], computes: tuple[bool, ...], meshes: tuple[Mesh, ...]) -> MeshRepairs:
    """Of all meshes together, each counted once.

    Parameters
    ----------
    names : tuple of str
        What each object's mesh is called: its file as the scene names it, or the object.
    computes : tuple of bool
        Does the scene say how the object's normals are made where its file has none?
    """
    each = {id(mesh): located(mesh.repairs, name) for name, mesh in zip(names, meshes, strict=True)}
    found = dict(joined(each.values()))
    for name, says_how, mesh in zip(names, computes, meshes, strict=True):
        index = mesh.corner_normals
        if says_how and index is not None and len(index) and (index >= 0).all():
            note(found, NORMALS_OF_FILE, name)
    return MeshRepairs(found)


def undirected(names: tuple[str, ...], wants: tuple[bool, ...], meshes: tuple[Mesh, ...]) -> MeshRepairs:
    """Objects whose material has a grain that neither the scene nor uv direct; `wants` says which need uv."""
    found: dict[str, Repair] = {}
    for name, wants_uv, mesh in zip(names, wants, meshes, strict=True):
        if wants_uv and mesh.uvs is None and mesh.polygon_count:
            note(found, NO_GRAIN, name)
    return MeshRepairs(found)


def unnamed(
    names: tuple[str, ...], selects: tuple[tuple[tuple[str, ...], bool] | None, ...], meshes: tuple[Mesh, ...]
) -> MeshRepairs:
    """Materials that mesh files select by name and nobody has, or nobody asked for.

    `selects` says of each object among which of the scene's materials its mesh selects, and whether it has
    those of its file; None where the object has one material.
    """
    found: dict[str, Repair] = {}
    for name, own, mesh in zip(names, selects, meshes, strict=True):
        known, imports = own or ((), False)
        missing = set(mesh.material_names) - set(known)
        if own is None or not missing or (imports and mesh.materials):  # what a library lacks is told already
            continue
        note(found, NOT_ASKED if missing & mesh.materials.keys() else NO_MATERIAL, name, len(missing))
    return MeshRepairs(found)


def tracer_over(world: SceneGeometry) -> Tracer:
    """The ray core over the world's triangles."""
    return Tracer(world.vertices, world.triangles)


def open_facets(world: SceneGeometry) -> OpenTriangles | None:
    """What tells triangles with nothing above them; None for meshes so large that it does not pay."""
    return OpenTriangles(world) if len(world.vertices) <= LARGEST_HORIZON else None


def facet_normals(world: SceneGeometry) -> Vectors:
    """(T, 3) float32 unit normals of all triangles."""
    v0, v1, v2 = (
        column_major(take_rows(world.vertices, world.triangles[:, k]), np.float64) for k in range(3)
    )
    return column_major(unit(cross(v1 - v0, v2 - v0)), F)


class BakedValues(Record):
    """Obscurance that was baked at the world's corners."""

    values: CornerVectors  # (C, 1) NaN on meshes that have none
    repairs: Repairs


def baked(files: tuple[tuple[str, FileFingerprint | None], ...], world: SceneGeometry) -> BakedValues:
    """The values in each object's file: of its corners where it has them, else of its vertices.

    Raises
    ------
    InputError
        A file that holds values for another number of vertices.
    """
    from illumcli.visibility.baked import mesh_hash, read_npz

    values = np.full((sum(len(placed.mesh.corners) for placed in world.placed), 1), np.nan, F)
    repairs: dict[str, Repair] = {}
    for (name, file), placed in zip(files, world.placed, strict=True):
        if file is None:
            continue
        mesh, found = placed.mesh, read_npz(file.path)
        own = found.of_corners(name, mesh.corners, len(mesh.vertices))
        if own is None:
            raise InputError(
                f"{file.path}: holds {len(found.obscurance)} values, the mesh of {name} has "
                f"{len(mesh.vertices)} vertices; bake it again"
            )
        if mesh_hash(mesh.vertices, mesh.corners, mesh.starts) not in found.hashes():
            note(repairs, "values that were baked for another mesh of as many vertices", str(file.path))
        values[placed.first_corner : placed.first_corner + len(own), 0] = own
    return BakedValues(CornerVectors(values, np.arange(len(values), dtype=np.int32)), repairs)


def corner_normals(how: tuple[Any, ...], meshes: tuple[Mesh, ...], world: SceneGeometry) -> CornerVectors:
    """Shading normals of every corner.

    `how` says of each object whether they are its polygons' own (`flat`), what its file's description says
    (`Normals`), or the mesh's own (None).
    """
    from illumcli.geometry.normals import corner_normals as of_mesh

    known: dict[tuple[int, str, bool], Any] = {}
    own = []
    for mesh, said, placed in zip(meshes, how, world.placed, strict=True):
        key = (id(mesh), repr(said), placed.reversed is None)
        if key not in known:
            if said == "flat":
                known[key] = of_mesh(mesh, crease=0.0, use_file=False, turned=placed.reversed)
            elif said is not None:
                known[key] = of_mesh(mesh, said.weights, said.crease, said.source == "file", said.polygon)
            else:
                known[key] = of_mesh(mesh)
        own.append(known[key])
    return scene_geometry.scene_normals(world, own)


def uvs(world: SceneGeometry) -> CornerVectors:
    """Texture coordinates of every corner."""
    return scene_geometry.scene_uvs(world)


def uv_tangents(world: SceneGeometry, uvs: CornerVectors) -> CornerVectors:
    """Where u grows, at every corner of every triangle."""
    return surface.uv_tangents(world, uvs)


def planar_polygons(world: SceneGeometry, normals: CornerVectors | None = None) -> PlanarPolygons | None:
    """The planar polygons of more than three corners, where `normals` are given those that are not flat by
    them; None where there are none."""
    return planar.planar_polygons(world, normals)


def polygon_centres(world: SceneGeometry) -> PolygonCentres:
    """The centre of every polygon."""
    return scene_geometry.polygon_centres(world)


def polygon_normals(
    methods: tuple[Any, ...], meshes: tuple[Mesh, ...], world: SceneGeometry
) -> NDArray[np.float32]:
    """(P, 3) unit normal of every polygon, in scene directions, by each object's method."""
    from illumcli.geometry.normals import polygon_normals as of_mesh

    parts = []
    for mesh, method, placed in zip(meshes, methods, world.placed, strict=True):
        turned = of_mesh(mesh, method) @ cofactors(placed.matrix[:3, :3]).T
        size = np.linalg.norm(turned, axis=1, keepdims=True)
        sign: Any = -1 if placed.mirrored else 1
        if placed.reversed is not None:
            sign = np.where(placed.reversed, -sign, sign)[:, None]
        parts.append(np.divide(sign * turned, size, out=np.zeros_like(turned), where=size > 0))
    return column_major(np.concatenate(parts) if parts else np.zeros((0, 3)), F)


def numbering(choices: tuple[Choice, ...], named: tuple[str, ...], world: SceneGeometry) -> Numbering:
    """The material number of every triangle, whatever the materials' parameters are."""
    return number_materials(world, choices, frozenset(named))


def materials_of(
    models: Mapping[Token, Any],
    measured: Mapping[str, FileFingerprint],
    imported: tuple[str | None, ...],
    numbering: Numbering,
    meshes: tuple[Mesh, ...] = (),
) -> Materials:
    """The materials by number, their measurements found on disk; `meshes` where these bring some."""
    found = {
        token: model.at({"file": str(measured[model.file].path)}) if hasattr(model, "file") else model
        for token, model in models.items()
    }
    libraries = {name: mesh for name, mesh in zip(imported, meshes, strict=False) if name}
    return materials(numbering, found, libraries)


class Images(Value):
    """Reads the textures of a scene, each once."""

    contents: Mapping[str, FileFingerprint]
    """By path, those that the scene itself names."""
    loaded: Any = field(repr=False)
    known: dict[Any, NDArray[np.float32]] = field(default_factory=dict, repr=False)

    def __call__(self, path: str, space: Any) -> NDArray[np.float32]:
        """(H, W, C) linear image of a texture of the scene, or of a mesh's own library."""
        if (path, space) not in self.known:
            self.known[path, space] = self._read(path, space)
        return self.known[path, space]

    def _read(self, path: str, space: Any) -> NDArray[np.float32]:
        from illumcli.images.reader import read_embedded_texture, read_texture
        from illumcli.mesh_files import embedded_image, image_within
        from illumcli.scene.load import resolve

        if path in self.contents:
            return read_texture(self.contents[path].path, space)
        if (within := image_within(path)) is None:
            return read_texture(resolve(self.loaded, path), space)
        file, number = within
        data = embedded_image(resolve(self.loaded, file), number)
        return read_embedded_texture(data, f"{file}: images[{number}]", space)


def textures(
    object_names: tuple[str, ...], images: Images, purpose: str, world: SceneGeometry, materials: Materials
) -> Varying:
    """What the parameters of materials that serve `purpose` vary by."""
    return varying(world, materials, object_names, purpose, images)


# --- per tile: samples and what they see --------------------------------------------------------------


FEWEST, MOST = 1 << 12, 1 << 16
"""Samples per tile. Passes over 2^14 stay in a core's own cache, but hand the interpreter from thread to
thread four times as often as those over 2^16, which costs more."""
TILES = 24
"""For threads to share a picture has about so many, where that makes them no smaller than `FEWEST`."""


def tile_side(samples: int, pixels: int) -> int:
    """Pixels along a square tile's side, a multiple of 8."""
    shared = max(math.isqrt(FEWEST // samples), math.isqrt(pixels // TILES))
    return max(8, min(shared, math.isqrt(MOST // samples)) // 8 * 8)


class Tile(Value):
    """A rectangle of pixels."""

    x: int
    y: int
    width: int
    height: int

    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Column and row of every pixel, row by row from the top."""
        x, y = np.arange(self.x, self.x + self.width), np.arange(self.y, self.y + self.height)
        return np.tile(x, self.height), np.repeat(y, self.width)

    def grown(self, width: int, height: int) -> Tile:
        """The rectangle and a border of one pixel, within a film of this size."""
        x, y = max(self.x - 1, 0), max(self.y - 1, 0)
        right, lower = min(self.x + self.width + 1, width), min(self.y + self.height + 1, height)
        return Tile(x, y, right - x, lower - y)


def tiles(width: int, height: int, side: int, samples: int) -> list[list[Tile]]:
    """The tiles of a picture, row by row: squares, and the last of several rows ends in halves of what is
    left of it, as long as they hold `FEWEST` samples, so that threads end together."""
    out = []
    for y in range(0, height, side):
        own, last = min(side, height - y), 0 < y >= height - side
        row, x = [], 0
        while rest := width - x:
            half = min(-(-rest // 16) * 8, rest)
            ending = last and rest <= 2 * side and half * own * samples >= FEWEST
            row.append(Tile(x, y, half if ending else min(side, rest), own))
            x += row[-1].width
        out.append(row)
    return out


class Scattered(Tile):
    """Pixels that need not lie together, as a tile of one row."""

    columns: NDArray[np.int64]
    rows: NDArray[np.int64]

    @classmethod
    def at(cls, x: NDArray[np.int64], y: NDArray[np.int64]) -> Scattered:
        """The pixels of these columns and rows."""
        return cls(0, 0, len(x), 1, x, y)

    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return self.columns, self.rows


class Samples(Record):
    """The samples of a tile, pixel by pixel, row by row from the top: sample s of pixel p is lane
    p * per_pixel + s."""

    x: NDArray[np.int64]  # (P,) pixel
    y: NDArray[np.int64]  # (P,)
    points: NDArray[np.float64]  # (N, 2) in [0, 1)^2
    per_pixel: int
    first: int | None = None  # number of each pixel's first, where these are part of its samples

    def nearest(self) -> Ids:
        """(P,) the lane of the sample nearest to each pixel's centre."""
        distance = np.square(self.points[:, 0] - 0.5) + np.square(self.points[:, 1] - 0.5)
        own = np.argmin(distance.reshape(-1, self.per_pixel), axis=1)
        return (own + np.arange(len(self.x)) * self.per_pixel).astype(np.int32)


def samples(seed: int, view: Any, tile: Tile) -> Samples:
    """Where the tile's samples lie, keyed by pixel number."""
    x, y = tile.pixels()
    pixel = (y * view.width + x).astype(np.uint32)
    points = sampling.pixel_points(sampling.stream(seed, "pixel"), pixel, view.samples, view.first)
    return Samples(x, y, points, view.samples, view.first)


class Rays(Record):
    """Primary rays of a tile."""

    origins: Vectors
    directions: Vectors
    skipped: Floats  # (N,) float64 from the eye to the origin, in radii


def rays(film_filter: Any, frame: RenderSpace, view: Any, samples: Samples) -> Rays:
    """A ray per sample; a single sample looks through its pixel's centre whatever the filter."""
    several = samples.per_pixel > 1 or samples.first is not None
    points = film_points(samples.x, samples.y, samples.points, film_filter if several else None)
    return Rays(*camera_rays(view.camera, frame, view.width, view.height, points))


def hits(tracer: Tracer, rays: Rays) -> Hits:
    """What the samples see."""
    return surface.seen(tracer.closest(rays.origins, rays.directions))


def facets(world: SceneGeometry, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Where they see it."""
    towards_eye = -take_rows(rays.directions, hits.lane)
    return surface.facets(world, hits.triangle, hits.u, hits.v, towards_eye)


def corner_weights(
    world: SceneGeometry, hits: Hits, planar_polygons: PlanarPolygons | None = None
) -> CornerWeights:
    """What the corners around each sample weigh there."""
    return corner_weights_at(world, planar_polygons, hits.triangle, hits.u, hits.v)


def points(
    rate: list[str],
    world: SceneGeometry,
    corner_weights: CornerWeights,
    facets: SurfaceInteraction,
    normals: CornerVectors | None = None,
    centres: PolygonCentres | None = None,
    polygon_normals: NDArray[np.float32] | None = None,
) -> Points:
    """Where models are evaluated."""
    return shading_rates.points(world, corner_weights, facets, rate, normals, centres, polygon_normals)


def point_weights(points: Points, corner_weights: CornerWeights) -> CornerWeights:
    """What the corners around each point weigh there."""
    return corner_weights if points.weights is None else points.weights


def material(world: SceneGeometry, numbering: Numbering, points: Points) -> Ids:
    """(E,) material number at every point."""
    return numbering.number(world, points.triangle)


def parameters(
    world: SceneGeometry, textures: Varying, material: Ids, point_weights: CornerWeights, uvs: CornerVectors
) -> Parameters:
    """The parameters that vary over the surface, at every point."""
    return parameters_at(world, textures, material, point_weights, uvs)


def view_vectors(view: Any, frame: RenderSpace, points: Points) -> Vectors:
    """(E, 3) float32 unit vectors to the eye."""
    if view.camera.projection == "orthographic":
        backward = (-camera_axes(view.camera)[2]).astype(F)
        return np.asfortranarray(np.broadcast_to(backward, points.position.shape))
    from illumcli.lights._base import towards

    return towards(frame.from_world(view.camera.position), points.position)[0]


def tangents(
    grains: tuple[Any, ...],
    world: SceneGeometry,
    points: Points,
    point_weights: CornerWeights | None = None,
    uv_tangents: CornerVectors | None = None,
) -> Vectors:
    """(E, 3) float32 unit tangents: the grain of each object, or the direction of growing u."""
    if uv_tangents is None or point_weights is None:
        grain = np.zeros_like(points.n)
    else:
        grain = point_weights.interpolate(world, uv_tangents)
    number = world.objects.take(points.triangle)
    for i, (own, placed) in enumerate(zip(grains, world.placed, strict=True)):
        if own is None or not (lanes := np.flatnonzero(number == i)).size:
            continue
        linear = placed.matrix[:3, :3] / np.abs(placed.matrix[:3, :3]).max()
        if isinstance(own, tuple):
            way = linear @ (np.asarray(own) / np.abs(own).max())
            grain[lanes] = way / (np.linalg.norm(way) or 1.0)
        else:
            centre = world.frame.from_world(placed.matrix[:3, :3] @ own.centre + placed.matrix[:3, 3])
            grain[lanes] = surface.rings(linear, own.axis, centre, take_rows(points.position, lanes))
    return surface.tangent(points.n, surface.unit(grain))


# --- per tile: light ----------------------------------------------------------------------------------


def lit(light: Light, frame: RenderSpace, points: Points) -> LitPoints:
    """The points a light reaches if nothing stands between."""
    return lit_lanes(light, frame, points.position, points.n)


def reach(light: Light, frame: RenderSpace, facets: SurfaceInteraction) -> LitPoints:
    """The samples whose vertices or polygons a light may reach."""
    return lit_lanes(light, frame, column_major(facets.position, F))


def same(lit: LitPoints) -> LitPoints:
    """The points are the samples."""
    return lit


def free(light: Light, frame: RenderSpace, points: Points, shadow: Floats) -> LitPoints:
    """The points that a light reaches and that are not in shadow, where points are samples.

    The shadow alone says which: it is 0 where the light does not reach.
    """
    return reaching(light, frame, points.position, np.flatnonzero(shadow != 0))


def ray_origins(facets: SurfaceInteraction) -> Vectors:
    """(M, 3) where shadow and obscurance rays start."""
    return shadows.ray_origins(facets)


def smooth_parts(world: SceneGeometry, normals: CornerVectors) -> SmoothParts:
    """Which triangles form one smooth surface."""
    return SmoothParts(world, normals)


def smooth_surface(
    flat: tuple[bool, ...],
    world: SceneGeometry,
    corner_weights: CornerWeights,
    facets: SurfaceInteraction,
    smooth_parts: SmoothParts,
    normals: CornerVectors,
) -> shadows.SmoothSurface:
    """The samples on the surface that their normals imply; those of `flat` objects stay on their polygons."""
    return shadows.SmoothSurface(
        world, normals, smooth_parts, corner_weights, facets, np.array(flat, np.bool_)
    )


def shadow(
    tracer: Tracer, ray_origins: Vectors, reach: LitPoints, smooth: shadows.SmoothSurface | None = None
) -> Floats:
    """(M,) delta of one light."""
    return shadows.shadow(tracer, ray_origins, reach, smooth)


def no_shadow(hits: Hits) -> Floats:
    """(M,) delta of a light that casts no shadow."""
    return np.ones(len(hits.lane), F)


def black(hits: Hits) -> Vectors:
    """(M, 3) nothing."""
    return np.zeros((len(hits.lane), 3), F, order="F")


def direct(
    color: tuple[float, float, float],
    materials: Materials,
    material: Ids,
    points: Points,
    lit: LitPoints,
    v: Vectors | None = None,
    t: Vectors | None = None,
    parameters: Parameters | None = None,
) -> dict[str, Vectors]:
    """One light's response per lobe at the samples, its shadow not applied."""
    given = {"n": points.n} | ({"v": v} if v is not None else {}) | ({"t": t} if t is not None else {})
    at_points = shading.response(materials.models, materials.lobes, material, lit, color, given, parameters)
    return {name: points.spread(value) for name, value in at_points.items()}


def lobe_sum(hits: Hits, direct: dict[str, Vectors], shadow: Floats | None = None) -> Vectors:
    """(M, 3) one light with its shadow."""
    return _shadowed(total(hits, **direct), shadow)


def one_lobe(name: str, hits: Hits, direct: dict[str, Vectors], shadow: Floats | None = None) -> Vectors:
    """(M, 3) one lobe of one light with its shadow."""
    return _shadowed(direct[name] if name in direct else black(hits), shadow)


def arriving_light(
    color: tuple[float, float, float], points: Points, lit: LitPoints, shadow: Floats | None = None
) -> Vectors:
    """(M, 3) I_d of one light: what arrives on the surface, its cosine included."""
    out = np.zeros((lit.count, 3), F, order="F")
    cosine = dot(take_rows(points.n, lit.lane), lit.l)
    out[lit.lane] = (lit.strength * cosine)[:, None] * np.asarray(color, F)
    return _shadowed(points.spread(out), shadow)


def _shadowed(value: Vectors, shadow: Floats | None) -> Vectors:
    return value if shadow is None else value * shadow[:, None]


def total(hits: Hits, **parts: Vectors) -> Vectors:
    """(M, 3) the sum of the parts, in their order."""
    if not parts:
        return black(hits)
    first, *others = parts.values()
    if not others:
        return first
    out = first + others[0]
    for part in others[1:]:
        out += part
    return out


def depth_cued(
    cue: DepthCue, view: Any, frame: RenderSpace, facets: SurfaceInteraction, uncued: Vectors
) -> Vectors:
    """(M, 3) light that fades into a colour with the distance from the eye."""
    share = (distance(view, frame, facets) - cue.near) / (cue.far - cue.near)
    fade = (cue.strength * np.clip(share, 0, 1)).astype(F)[:, None]
    return (1 - fade) * uncued + fade * np.asarray(cue.color, F)


def obscurance_normals(
    rate: list[str],
    world: SceneGeometry,
    corner_weights: CornerWeights,
    facets: SurfaceInteraction,
    normals: CornerVectors,
) -> Vectors:
    """(M, 3) what the hemisphere of obscurance stands about: the interpolated shading normal."""
    return shading_rates.sample_normals(world, corner_weights, facets, rate, normals)


def obscurance_draws(seed: int, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): what the obscurance rays of every sample seen are turned and phased by."""
    key = sampling.stream(seed, "obscurance")
    pixel = hits.lane // samples.per_pixel
    sample = hits.lane - pixel * samples.per_pixel
    return sampling.dither(key, samples.x.take(pixel), samples.y.take(pixel), sample + (samples.first or 0))


def obscurance(
    settings: Obscurance,
    tracer: Tracer,
    world: SceneGeometry,
    hits: Hits,
    facets: SurfaceInteraction,
    ray_origins: Vectors,
    obscurance_draws: NDArray[np.float64],
    obscurance_normals: Vectors | None = None,
    open_facets: OpenTriangles | None = None,
    baked: BakedValues | None = None,
    facet_normals: Vectors | None = None,
    corner_weights: CornerWeights | None = None,
) -> Floats:
    """(M,) w of every sample seen; on meshes with baked values these, and rays for the others.

    About the geometric normals where no others are given.
    """
    method = Method(
        settings.samples,
        settings.falloff,
        world.frame.radius,
        settings.sampler,
        settings.faces,
        facet_normals,
    )
    known = None
    if open_facets is not None:
        known = open_facets.is_open(hits.triangle, facets.behind, WORTH_RAYS // settings.samples)
    if obscurance_normals is None:
        over = Hemispheres(facets.ng, ray_origins, known_open=known)
    else:
        over = Hemispheres(obscurance_normals, ray_origins, facets.ng, known)
    if baked is None or corner_weights is None:
        return estimates(tracer, over, obscurance_draws, method, errors=False).w
    w = baked_obscurance(world, baked, corner_weights)
    left = np.flatnonzero(np.isnan(w))
    w[left] = estimates(tracer, over.take(left), obscurance_draws[:, left], method, errors=False).w
    return w


def baked_obscurance(world: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) baked values interpolated over polygons; NaN on meshes that have none."""
    w: Floats = corner_weights.interpolate(world, baked.values)[:, 0]
    return w


def baked_or_open(world: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) the same; 1 on meshes that have none."""
    w = baked_obscurance(world, baked, corner_weights)
    return np.where(np.isnan(w), F(1), w)


def ambient_color(
    materials: Materials, material: Ids, points: Points, parameters: Parameters | None = None
) -> Vectors:
    """(M, 3) k_a."""
    return points.spread(
        surface_colors(materials.models, lambda model: model.ambient_color(), material, parameters)
    )


def ambient(color: Any, ambient_color: Vectors, obscurance: Floats | None = None) -> Vectors:
    """(M, 3) k_a I_a w."""
    return ambient_light(ambient_color, color, obscurance)


def coupled(
    color: Any, ambient_color: Vectors, direct: Vectors, unlit: Vectors, obscurance: Floats | None = None
) -> Vectors:
    """(M, 3) (k_a I_a + direct) w + I_d."""
    w = np.ones(len(ambient_color), F) if obscurance is None else obscurance
    return coupled_light(ambient_color, color, direct, unlit, w)


def emission(
    materials: Materials, material: Ids, points: Points, parameters: Parameters | None = None
) -> Vectors:
    """(M, 3) L_e."""
    return points.spread(surface_colors(materials.models, lambda model: model.emission, material, parameters))


# --- per tile: data layers ----------------------------------------------------------------------------


def alpha(hits: Hits) -> Floats:
    """(M,) 1 where a surface is seen."""
    return np.ones(len(hits.lane), F)


def depth(view: Any, frame: RenderSpace, facets: SurfaceInteraction) -> Floats:
    """(M,) distance from the eye's plane along the line of sight, at least 0 [scene units]."""
    forward = camera_axes(view.camera)[2]
    eye = frame.from_world(view.camera.position)
    along = np.maximum(dot(facets.position - eye, forward[None, :]), 0)
    return (along * frame.radius).astype(F)


def distance(view: Any, frame: RenderSpace, facets: SurfaceInteraction) -> Floats:
    """(M,) float64 distance along the line of sight from the eye, or from its plane [scene units]."""
    away = facets.position - frame.from_world(view.camera.position)
    if view.camera.projection == "orthographic":
        return dot(away, camera_axes(view.camera)[2][None, :]) * frame.radius
    return length(away) * frame.radius


def world_position(frame: RenderSpace, facets: SurfaceInteraction) -> Vectors:
    """(M, 3) [scene units]."""
    return column_major(frame.to_world(facets.position), F)


def normal(points: Points) -> Vectors:
    """(M, 3) unit shading normal on the side the eye sees."""
    return surface.unit(points.spread(points.n))


def geometric_normal(
    hits: Hits, facets: SurfaceInteraction, planar_polygons: PlanarPolygons | None = None
) -> Vectors:
    """(M, 3) unit normal of the polygon on the side the eye sees: Newell's of a planar one, else the
    triangle's."""
    return surface.polygon_facing(hits.triangle, facets, planar_polygons)


def uv(world: SceneGeometry, uvs: CornerVectors, hits: Hits) -> NDArray[np.float32]:
    """(M, 2) texture coordinates."""
    return surface.uv(world, uvs, corner_weights_at(world, None, hits.triangle, hits.u, hits.v))


def object_id(world: SceneGeometry, hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the object, from 1."""
    return (world.objects.take(hits.triangle) + 1).astype(np.uint32)


def material_id(world: SceneGeometry, numbering: Numbering, hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the material, from 1."""
    return (numbering.number(world, hits.triangle) + 1).astype(np.uint32)


def triangle_id(hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the triangle, from 1."""
    return (hits.triangle + 1).astype(np.uint32)
