"""The stages that join folders which do not know each other: thin functions from buffers to buffers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, take_rows, unit
from illumcli.cache.fingerprint import FileFingerprint
from illumcli.errors import InputError
from illumcli.film.tiles import Samples
from illumcli.film.view import View, distance
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
    MeshRepairs,
    Repair,
    Repairs,
    joined,
    located,
    note,
)
from illumcli.geometry.scene_geometry import CornerVectors, PolygonCentres, SceneGeometry
from illumcli.geometry.smooth_parts import SmoothParts
from illumcli.geometry.transforms import cofactors, transform_matrix
from illumcli.lights._incident import LitPoints
from illumcli.rays import interaction as surface
from illumcli.rays import sampling
from illumcli.rays.camera import Rays, framing
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
from illumcli.visibility.obscurance import Method, estimates
from illumcli.visibility.open_hemisphere import OpenTriangles
from illumcli.visibility.shadows import SmoothSurface

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


def object_bounds(transforms: tuple[Any, ...], meshes: tuple[Mesh, ...]) -> ObjectBounds:
    """Where every object stands, and the scene's centre and radius."""
    matrices = [transform_matrix(transform, mesh) for transform, mesh in zip(transforms, meshes, strict=True)]
    return bounds.object_bounds(meshes, matrices)


Placement: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float], float | None]
"""Position, target and, of orthographic cameras, extent."""


def framed(
    camera: Any, aspect: float, number: int, meshes: tuple[Mesh, ...], object_bounds: ObjectBounds
) -> Placement:
    """Where a camera stands whose picture the object of this number fills."""
    mesh = meshes[number]
    points = bounds.take_used(mesh, bounds.transformed_vertices(mesh, object_bounds.matrices[number]))
    made = framing(camera, aspect, points)
    return made.position, made.target, getattr(made, "extent", None)


def implied_widths(
    flat: tuple[bool, ...], meshes: tuple[Mesh, ...], object_bounds: ObjectBounds
) -> NDArray[np.float64]:
    """(O,) the widest polygon of each object whose normals imply another surface [scene units], else 0."""
    sizes = [
        0.0 if own else bounds.widest_polygon(mesh, matrix)
        for own, mesh, matrix in zip(flat, meshes, object_bounds.matrices, strict=True)
    ]
    return np.array(sizes, np.float64)


def left(unseen: tuple[int, ...], meshes: tuple[Mesh, ...]) -> tuple[Mesh, ...]:
    """The meshes, those of objects that nobody sees without their polygons."""
    return tuple(
        scene_geometry.without_polygons(mesh) if number in unseen else mesh
        for number, mesh in enumerate(meshes)
    )


def geometry(
    by_file: tuple[bool, ...], meshes: tuple[Mesh, ...], object_bounds: ObjectBounds
) -> SceneGeometry:
    """All triangles, placed, recentred and scaled to unit radius; `by_file` says of which objects the
    file's normals are used."""
    return scene_geometry.place_meshes(meshes, object_bounds.matrices, object_bounds.render_space, by_file)


def render_space(object_bounds: ObjectBounds) -> RenderSpace:
    """The scene's centre and radius."""
    return object_bounds.render_space


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


def tracer_over(geometry: SceneGeometry) -> Tracer:
    """The ray core over the world's triangles."""
    return Tracer(geometry.vertices, geometry.triangles)


def open_triangles(geometry: SceneGeometry) -> OpenTriangles | None:
    """What tells triangles with nothing above them; None for meshes so large that it does not pay."""
    return OpenTriangles(geometry) if len(geometry.vertices) <= LARGEST_HORIZON else None


def triangle_normals(geometry: SceneGeometry) -> Vectors:
    """(T, 3) float32 unit normals of all triangles."""
    v0, v1, v2 = (
        column_major(take_rows(geometry.vertices, geometry.triangles[:, k]), np.float64) for k in range(3)
    )
    return column_major(unit(cross(v1 - v0, v2 - v0)), F)


class BakedValues(Record):
    """Obscurance that was baked at the world's corners."""

    values: CornerVectors  # (C, 1) NaN on meshes that have none
    repairs: Repairs


def baked(files: tuple[tuple[str, FileFingerprint | None], ...], geometry: SceneGeometry) -> BakedValues:
    """The values in each object's file: of its corners where it has them, else of its vertices.

    Raises
    ------
    InputError
        A file that holds values for another number of vertices.
    """
    from illumcli.visibility.baked import mesh_hash, read_npz

    values = np.full((sum(len(placed.mesh.corners) for placed in geometry.placed), 1), np.nan, F)
    repairs: dict[str, Repair] = {}
    for (name, file), placed in zip(files, geometry.placed, strict=True):
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


def corner_normals(how: tuple[Any, ...], meshes: tuple[Mesh, ...], geometry: SceneGeometry) -> CornerVectors:
    """Shading normals of every corner.

    `how` says of each object whether they are its polygons' own (`flat`), what its file's description says
    (`Normals`), or the mesh's own (None).
    """
    from illumcli.geometry.corner_normals import corner_normals as of_mesh

    known: dict[tuple[int, str, bool], Any] = {}
    own = []
    for mesh, said, placed in zip(meshes, how, geometry.placed, strict=True):
        key = (id(mesh), repr(said), placed.reversed is None)
        if key not in known:
            if said == "flat":
                known[key] = of_mesh(mesh, crease=0.0, use_file=False, turned=placed.reversed)
            elif said is not None:
                known[key] = of_mesh(mesh, said.weights, said.crease, said.source == "file", said.polygon)
            else:
                known[key] = of_mesh(mesh)
        own.append(known[key])
    return scene_geometry.scene_normals(geometry, own)


def uvs(geometry: SceneGeometry) -> CornerVectors:
    """Texture coordinates of every corner."""
    return scene_geometry.scene_uvs(geometry)


def uv_tangents(geometry: SceneGeometry, uvs: CornerVectors) -> CornerVectors:
    """Where u grows, at every corner of every triangle."""
    return surface.uv_tangents(geometry, uvs)


def planar_polygons(geometry: SceneGeometry, normals: CornerVectors | None = None) -> PlanarPolygons | None:
    """The planar polygons of more than three corners, where `normals` are given those that are not flat by
    them; None where there are none."""
    return planar.planar_polygons(geometry, normals)


def polygon_centres(geometry: SceneGeometry) -> PolygonCentres:
    """The centre of every polygon."""
    return scene_geometry.polygon_centres(geometry)


def polygon_normals(
    methods: tuple[Any, ...], meshes: tuple[Mesh, ...], geometry: SceneGeometry
) -> NDArray[np.float32]:
    """(P, 3) unit normal of every polygon, in scene directions, by each object's method."""
    from illumcli.geometry.polygon_normals import polygon_normals as of_mesh

    parts = []
    for mesh, method, placed in zip(meshes, methods, geometry.placed, strict=True):
        turned = of_mesh(mesh, method) @ cofactors(placed.matrix[:3, :3]).T
        size = np.linalg.norm(turned, axis=1, keepdims=True)
        sign: Any = -1 if placed.mirrored else 1
        if placed.reversed is not None:
            sign = np.where(placed.reversed, -sign, sign)[:, None]
        parts.append(np.divide(sign * turned, size, out=np.zeros_like(turned), where=size > 0))
    return column_major(np.concatenate(parts) if parts else np.zeros((0, 3)), F)


def numbering(choices: tuple[Choice, ...], named: tuple[str, ...], geometry: SceneGeometry) -> Numbering:
    """The material number of every triangle, whatever the materials' parameters are."""
    return number_materials(geometry, choices, frozenset(named))


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
        from illumcli.scene.access import resolve

        if path in self.contents:
            return read_texture(self.contents[path].path, space)
        if (within := image_within(path)) is None:
            return read_texture(resolve(self.loaded, path), space)
        file, number = within
        data = embedded_image(resolve(self.loaded, file), number)
        return read_embedded_texture(data, f"{file}: images[{number}]", space)


def textures(
    object_names: tuple[str, ...], images: Images, purpose: str, geometry: SceneGeometry, materials: Materials
) -> Varying:
    """What the parameters of materials that serve `purpose` vary by."""
    return varying(geometry, materials, object_names, purpose, images)


# --- per tile: samples and what they see --------------------------------------------------------------


def hits(tracer: Tracer, rays: Rays) -> Hits:
    """What the samples see."""
    return surface.seen(tracer.closest(rays.origins, rays.directions))


def interaction(geometry: SceneGeometry, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Where they see it."""
    towards_eye = -take_rows(rays.directions, hits.sample)
    return surface.interact(geometry, hits.triangle, hits.u, hits.v, towards_eye)


def corner_weights(
    geometry: SceneGeometry, hits: Hits, planar_polygons: PlanarPolygons | None = None
) -> CornerWeights:
    """What the corners around each sample weigh there."""
    return corner_weights_at(geometry, planar_polygons, hits.triangle, hits.u, hits.v)


def points(
    rate: list[str],
    geometry: SceneGeometry,
    corner_weights: CornerWeights,
    interaction: SurfaceInteraction,
    normals: CornerVectors | None = None,
    centres: PolygonCentres | None = None,
    polygon_normals: NDArray[np.float32] | None = None,
) -> Points:
    """Where models are evaluated."""
    return shading_rates.points(
        geometry, corner_weights, interaction, rate, normals, centres, polygon_normals
    )


def point_weights(points: Points, corner_weights: CornerWeights) -> CornerWeights:
    """What the corners around each point weigh there."""
    return corner_weights if points.weights is None else points.weights


def material(geometry: SceneGeometry, numbering: Numbering, points: Points) -> Ids:
    """(E,) material number at every point."""
    return numbering.number(geometry, points.triangle)


def parameters(
    geometry: SceneGeometry,
    textures: Varying,
    material: Ids,
    point_weights: CornerWeights,
    uvs: CornerVectors,
) -> Parameters:
    """The parameters that vary over the surface, at every point."""
    return parameters_at(geometry, textures, material, point_weights, uvs)


def tangents(
    grains: tuple[Any, ...],
    geometry: SceneGeometry,
    points: Points,
    point_weights: CornerWeights | None = None,
    uv_tangents: CornerVectors | None = None,
) -> Vectors:
    """(E, 3) float32 unit tangents: the grain of each object, or the direction of growing u."""
    if uv_tangents is None or point_weights is None:
        grain = np.zeros_like(points.n)
    else:
        grain = point_weights.interpolate(geometry, uv_tangents)
    number = geometry.objects.take(points.triangle)
    for i, (own, placed) in enumerate(zip(grains, geometry.placed, strict=True)):
        if own is None or not (lanes := np.flatnonzero(number == i)).size:
            continue
        linear = placed.matrix[:3, :3] / np.abs(placed.matrix[:3, :3]).max()
        if isinstance(own, tuple):
            way = linear @ (np.asarray(own) / np.abs(own).max())
            grain[lanes] = way / (np.linalg.norm(way) or 1.0)
        else:
            centre = geometry.render_space.from_world(
                placed.matrix[:3, :3] @ own.centre + placed.matrix[:3, 3]
            )
            grain[lanes] = surface.rings(linear, own.axis, centre, take_rows(points.position, lanes))
    return surface.tangent(points.n, surface.unit(grain))


# --- per tile: light ----------------------------------------------------------------------------------


def ray_origins(interaction: SurfaceInteraction) -> Vectors:
    """(M, 3) where shadow and obscurance rays start."""
    return shadows.ray_origins(interaction)


def smooth_parts(geometry: SceneGeometry, normals: CornerVectors) -> SmoothParts:
    """Which triangles form one smooth surface."""
    return SmoothParts(geometry, normals)


def smooth_surface(
    flat: tuple[bool, ...],
    geometry: SceneGeometry,
    corner_weights: CornerWeights,
    interaction: SurfaceInteraction,
    smooth_parts: SmoothParts,
    normals: CornerVectors,
) -> shadows.SmoothSurface:
    """The samples on the surface that their normals imply; those of `flat` objects stay on their polygons."""
    return shadows.SmoothSurface(
        geometry, normals, smooth_parts, corner_weights, interaction, np.array(flat, np.bool_)
    )


def shadow(
    tracer: Tracer,
    ray_origins: Vectors,
    shadow_candidates: LitPoints,
    smooth: SmoothSurface | None = None,
) -> Floats:
    """(M,) delta of one light."""
    return shadows.shadow(tracer, ray_origins, shadow_candidates, smooth)


def no_shadow(hits: Hits) -> Floats:
    """(M,) delta of a light that casts no shadow."""
    return np.ones(len(hits.sample), F)


def black(hits: Hits) -> Vectors:
    """(M, 3) nothing."""
    return np.zeros((len(hits.sample), 3), F, order="F")


def direct(
    color: tuple[float, float, float],
    materials: Materials,
    material: Ids,
    points: Points,
    incident: LitPoints,
    v: Vectors | None = None,
    t: Vectors | None = None,
    parameters: Parameters | None = None,
) -> dict[str, Vectors]:
    """One light's response per lobe at the samples, its shadow not applied."""
    given = {"n": points.n} | ({"v": v} if v is not None else {}) | ({"t": t} if t is not None else {})
    at_points = shading.response(
        materials.models, materials.lobes, material, incident, color, given, parameters
    )
    return {name: points.spread(value) for name, value in at_points.items()}


def sum_lobes(hits: Hits, direct: dict[str, Vectors], shadow: Floats | None = None) -> Vectors:
    """(M, 3) one light with its shadow."""
    return _shadowed(total(hits, **direct), shadow)


def one_lobe(name: str, hits: Hits, direct: dict[str, Vectors], shadow: Floats | None = None) -> Vectors:
    """(M, 3) one lobe of one light with its shadow."""
    return _shadowed(direct[name] if name in direct else black(hits), shadow)


def irradiance(
    color: tuple[float, float, float], points: Points, incident: LitPoints, shadow: Floats | None = None
) -> Vectors:
    """(M, 3) I_d of one light: what arrives on the surface, its cosine included."""
    out = np.zeros((incident.count, 3), F, order="F")
    cosine = dot(take_rows(points.n, incident.index), incident.l)
    out[incident.index] = (incident.irradiance_scale * cosine)[:, None] * np.asarray(color, F)
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
    cue: DepthCue, view: View, render_space: RenderSpace, interaction: SurfaceInteraction, uncued: Vectors
) -> Vectors:
    """(M, 3) light that fades into a colour with the distance from the eye."""
    share = (distance(view, render_space, interaction) - cue.near) / (cue.far - cue.near)
    fade = (cue.strength * np.clip(share, 0, 1)).astype(F)[:, None]
    return (1 - fade) * uncued + fade * np.asarray(cue.color, F)


def obscurance_normals(
    rate: list[str],
    geometry: SceneGeometry,
    corner_weights: CornerWeights,
    interaction: SurfaceInteraction,
    normals: CornerVectors,
) -> Vectors:
    """(M, 3) what the hemisphere of obscurance stands about: the interpolated shading normal."""
    return shading_rates.sample_normals(geometry, corner_weights, interaction, rate, normals)


def obscurance_draws(seed: int, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): what the obscurance rays of every sample seen are turned and phased by."""
    key = sampling.stream(seed, "obscurance")
    pixel = hits.sample // samples.per_pixel
    sample = hits.sample - pixel * samples.per_pixel
    return sampling.dither(key, samples.x.take(pixel), samples.y.take(pixel), sample + (samples.first or 0))


def obscurance(
    settings: Obscurance,
    tracer: Tracer,
    geometry: SceneGeometry,
    hits: Hits,
    interaction: SurfaceInteraction,
    ray_origins: Vectors,
    obscurance_draws: NDArray[np.float64],
    obscurance_normals: Vectors | None = None,
    open_triangles: OpenTriangles | None = None,
    baked: BakedValues | None = None,
    triangle_normals: Vectors | None = None,
    corner_weights: CornerWeights | None = None,
) -> Floats:
    """(M,) w of every sample seen; on meshes with baked values these, and rays for the others.

    About the geometric normals where no others are given.
    """
    method = Method(
        settings.samples,
        settings.falloff,
        geometry.render_space.radius,
        settings.sampler,
        settings.faces,
        triangle_normals,
    )
    known = None
    if open_triangles is not None:
        known = open_triangles.is_open(hits.triangle, interaction.back_facing, WORTH_RAYS // settings.samples)
    if obscurance_normals is None:
        over = Hemispheres(interaction.ng, ray_origins, known_open=known)
    else:
        over = Hemispheres(obscurance_normals, ray_origins, interaction.ng, known)
    if baked is None or corner_weights is None:
        return estimates(tracer, over, obscurance_draws, method, errors=False).w
    w = baked_obscurance(geometry, baked, corner_weights)
    left = np.flatnonzero(np.isnan(w))
    w[left] = estimates(tracer, over.take(left), obscurance_draws[:, left], method, errors=False).w
    return w


def baked_obscurance(geometry: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) baked values interpolated over polygons; NaN on meshes that have none."""
    w: Floats = corner_weights.interpolate(geometry, baked.values)[:, 0]
    return w


def baked_or_open(geometry: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) the same; 1 on meshes that have none."""
    w = baked_obscurance(geometry, baked, corner_weights)
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
    color: Any, ambient_color: Vectors, direct: Vectors, irradiance: Vectors, obscurance: Floats | None = None
) -> Vectors:
    """(M, 3) (k_a I_a + direct) w + I_d."""
    w = np.ones(len(ambient_color), F) if obscurance is None else obscurance
    return coupled_light(ambient_color, color, direct, irradiance, w)


def emission(
    materials: Materials, material: Ids, points: Points, parameters: Parameters | None = None
) -> Vectors:
    """(M, 3) L_e."""
    return points.spread(surface_colors(materials.models, lambda model: model.emission, material, parameters))


# --- per tile: data layers ----------------------------------------------------------------------------


def alpha(hits: Hits) -> Floats:
    """(M,) 1 where a surface is seen."""
    return np.ones(len(hits.sample), F)


def world_position(render_space: RenderSpace, interaction: SurfaceInteraction) -> Vectors:
    """(M, 3) [scene units]."""
    return column_major(render_space.to_world(interaction.position), F)


def normal(points: Points) -> Vectors:
    """(M, 3) unit shading normal on the side the eye sees."""
    return surface.unit(points.spread(points.n))


def geometric_normal(
    hits: Hits, interaction: SurfaceInteraction, planar_polygons: PlanarPolygons | None = None
) -> Vectors:
    """(M, 3) unit normal of the polygon on the side the eye sees: Newell's of a planar one, else the
    triangle's."""
    return surface.polygon_facing(hits.triangle, interaction, planar_polygons)


def uv(geometry: SceneGeometry, uvs: CornerVectors, hits: Hits) -> NDArray[np.float32]:
    """(M, 2) texture coordinates."""
    return surface.uv(geometry, uvs, corner_weights_at(geometry, None, hits.triangle, hits.u, hits.v))


def object_id(geometry: SceneGeometry, hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the object, from 1."""
    return (geometry.objects.take(hits.triangle) + 1).astype(np.uint32)


def material_id(geometry: SceneGeometry, numbering: Numbering, hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the material, from 1."""
    return (numbering.number(geometry, hits.triangle) + 1).astype(np.uint32)


def triangle_id(hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the triangle, from 1."""
    return (hits.triangle + 1).astype(np.uint32)
