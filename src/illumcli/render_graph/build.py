"""Builds the render graph of a scene: a node for every buffer that a layer could need. Nothing runs here.

A node binds the function that does the work, and only those parts of the scene that it depends on: both are
its identity in the cache (`render_graph.keys`). The functions' parameter names are the buffers they read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from functools import partial
from typing import Any

from illumcli.cache.fingerprint import FileFingerprints
from illumcli.film.view import View, depth, rays, samples, view_vectors
from illumcli.geometry.planar import planar_polygons
from illumcli.geometry.scene_geometry import polygon_centres, scene_uvs, triangle_normals
from illumcli.graph import Node, topological_order
from illumcli.images.textures import Images
from illumcli.rays.camera import framed
from illumcli.rays.corner_weights import corner_weights
from illumcli.rays.interaction import (
    ShadingContext,
    geometric_normal,
    hits,
    interaction,
    object_id,
    triangle_id,
    uv,
    uv_tangents,
    world_position,
)
from illumcli.records import Value
from illumcli.render_graph import needs, stages
from illumcli.render_graph.build_adaptive import FITTED, adaptive_nodes
from illumcli.render_graph.build_geometry import baked_files, baked_mesh_nodes, geometry_nodes
from illumcli.render_graph.build_lights import light_nodes, shortcuts, sum_nodes
from illumcli.render_graph.build_materials import material_nodes
from illumcli.render_graph.replicates import error_nodes
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Obscurance, Scene
from illumcli.shading.grain import tangents
from illumcli.shading.materials import material, material_id
from illumcli.shading.occlusion_maps import mapped_obscurance, occlusion_maps
from illumcli.shading.rates import RATES, normal, normals_of_points, obscurance_normals, point_weights, points
from illumcli.visibility.baked_corners import Files, baked, baked_obscurance
from illumcli.visibility.hemisphere import hemispheres
from illumcli.visibility.object_pixels import object_pixels, obscurance_of_samples, pixel_pairs
from illumcli.visibility.obscurance import baked_or_open, obscurance_method
from illumcli.visibility.open_hemisphere import known_open, open_triangles
from illumcli.visibility.reconstruction import fitted_obscurance
from illumcli.visibility.shadows import ray_origins

SURROUNDINGS = "surrounding_pixels"
"""The buffer `object_pixels` of the tiles around one, so far as a reconstruction reads them."""
READ = "read_pixels"
"""The buffer of the pixels of a tile whose obscurance is read, (P,), None if it is all of them."""
GIVEN = ("view", "tile", SURROUNDINGS, READ)
"""Buffers that need no node."""


class Known(Value):
    """A buffer of the whole scene that was computed or loaded before the graph is scheduled."""

    value: Any
    source: str = ""
    """Where it was loaded from, `memory` or `store`; empty if it was computed in this run."""


class Graph(Value):
    """All nodes of a scene, by the buffer that each computes, and the scene's views."""

    scene: Scene
    views: tuple[View, ...]
    nodes: Mapping[str, Node] = field(repr=False)
    known: Mapping[str, Known] = field(default_factory=dict, repr=False)
    """Buffers of the whole scene with known values, which need no node."""
    loaders: Mapping[str, Node] = field(default_factory=dict, repr=False)
    """Nodes that load a buffer of one view instead of computing it."""
    shortcuts: Mapping[str, Node] = field(default_factory=dict, repr=False)
    """Buffer -> a node that computes the same from other inputs, for use where those that it has in common
    with the buffer's own node are loaded."""
    culled: tuple[int, ...] = ()
    """Numbers of the culled objects, which cannot affect any view."""
    reasons: Mapping[str, str] = field(default_factory=dict, repr=False)
    """Buffer -> why this scene does not need it; it is computed all the same if an output needs it."""

    def topological_order(self, buffers: Iterable[str]) -> list[Node]:
        """The nodes that some buffers need, each after its inputs; cached buffers have loaders."""
        return topological_order({**self.nodes, **self.loaders}, buffers, GIVEN)

    def why_not(self, name: str) -> str:
        """Why a buffer that no output needs is not computed."""
        return self.reasons.get(name, "no requested layer needs it")

    def without_loaders(self) -> Graph:
        """The graph before cached buffers were substituted."""
        return replace(self, loaders={})


def build(
    scene: Scene, loaded: SceneFile, files: FileFingerprints | None = None, shares_meshes: bool = True
) -> Graph:
    """The graph of a scene. Reads no mesh, runs nothing.

    A node binds only those parts of the scene that its buffer depends on: they are its key in the cache
    (`render_graph.keys`). The buffers `view` and `tile` are given.

    Parameters
    ----------
    files : FileFingerprints, optional
        Those that variants of the scene share.
    shares_meshes : bool
        False for a geometry with the elements of every object, as a bake needs it.
    """
    files = files or FileFingerprints()
    nodes = [
        *geometry_nodes(scene, loaded, files, shares_meshes),
        *_surface_nodes(scene),
        *_obscurance_nodes(scene, loaded, files),
        *_data_nodes(),
        *material_nodes(scene, loaded, files),
        *light_nodes(scene),
        *sum_nodes(scene),
        *_camera_nodes(scene),
    ]
    by_name = {node.output: node for node in nodes}
    views = tuple(needs.views(scene))
    counts = [view.samples for view in views]
    by_name |= adaptive_nodes(scene, by_name, GIVEN)
    if not needs.reconstructs(scene):  # there an audit of the finished picture makes the error
        by_name |= error_nodes(by_name, scene.seed, scene.film.background, counts, GIVEN)
    known_shorter = {name: node for name, node in shortcuts(scene).items() if name in by_name}
    return Graph(scene, views, by_name, shortcuts=known_shorter, reasons=_reasons(scene, by_name))


def _surface_nodes(scene: Scene) -> list[Node]:
    """Nodes of samples, their hits, and the points where models are evaluated."""
    # The optional inputs of the nodes below.
    rates = needs.rates(scene)
    smooth = {"normals": "corner_normals"} if needs.is_smooth(scene) else {}
    of_polygons = any(RATES[rate].of_polygons for rate in rates)
    centres = {"centres": "polygon_centres", "polygon_normals": "polygon_normals"} if of_polygons else {}
    interpolates = any(not RATES[rate].of_polygons for rate in rates) or any(needs.is_baked(scene))
    planar = {"planar_polygons": "planar_polygons"} if interpolates else {}
    # If only normals are interpolated, polygons with equal normals at all corners need no weights.
    weights = "normal_weights" if all(RATES[rate].normals_alone for rate in set(rates)) and rates else None
    grains = tuple(thing.grain for thing in scene.objects)
    by_uv = {name: name for name in ("uv_tangents", "point_weights")} if None in grains else {}
    return [
        Node.of(partial(samples, scene.seed), "samples"),
        Node.of(partial(rays, scene.film.filter), "rays"),
        Node.of(hits),
        Node.of(interaction),
        Node.of(ray_origins),
        Node.of(planar_polygons),
        Node.of(planar_polygons, "curved_polygons", normals="corner_normals"),
        Node.of(corner_weights, **planar),
        Node.of(corner_weights, "normal_weights", planar_polygons="curved_polygons"),
        Node.of(ShadingContext, "shading_context", weights=weights or "corner_weights", **smooth),
        Node.of(polygon_centres),
        Node.of(partial(points, tuple(rates)), "points", **centres),
        Node.of(point_weights),
        Node.of(material),
        Node.of(scene_uvs, "uvs"),
        Node.of(uv_tangents),
        Node.of(partial(tangents, grains), "t", **by_uv),
        Node.of(view_vectors, "v"),
    ]


def _data_nodes() -> list[Node]:
    """Nodes of data layers. To add a layer, add a line here and a row to `layers.LAYERS`."""
    return [
        Node.of(stages.alpha),
        Node.of(depth),
        Node.of(world_position),
        Node.of(normal),
        Node.of(geometric_normal, planar_polygons="planar_polygons"),
        Node.of(uv),
        Node.of(object_id),
        Node.of(material_id),
        Node.of(triangle_id),
    ]


def _obscurance_nodes(scene: Scene, loaded: SceneFile, files: FileFingerprints) -> list[Node]:
    """Nodes of obscurance, traced or baked."""
    # Which inputs w has.
    values = baked_files(scene, loaded, files)
    of_meshes = baked_mesh_nodes(scene, loaded, files)
    meshes = {"obscurance_meshes": "obscurance_meshes"} if of_meshes else {}
    some_baked = any(file for _, file in values)
    settings = scene.obscurance or Obscurance()
    settings = settings.model_copy(update={"reconstruct": None})  # no ray depends on it
    by_face = {name: name for name in ("triangle_normals", "geometry")} if settings.faces != "count" else {}
    axes = {"obscurance_normals": "obscurance_normals"} if _about_shading(scene) else {}
    partly_baked = {"baked_obscurance": "baked_obscurance"} if some_baked else {}
    if needs.all_baked(scene) or (scene.obscurance is None and some_baked):
        w = Node.of(baked_or_open, "obscurance")
    else:
        w = Node.of(stages.obscurance, **partly_baked)
    nodes = [w]
    if needs.reconstructs(scene):
        nodes = [
            replace(w, output="raw_obscurance"),
            Node.of(pixel_pairs, **partly_baked),
            Node.of(object_pixels),
            Node.of(fitted_obscurance),
            Node.of(obscurance_of_samples, "obscurance", **partly_baked),
        ]
    return [
        Node.of(partial(stages.obscurance_draws, scene.seed), "obscurance_draws"),
        _obscurance_normals(scene),
        Node.of(triangle_normals),
        Node.of(partial(obscurance_method, settings), "obscurance_method", **by_face),
        Node.of(stages.view_method),
        Node.of(stages.read_hits),
        Node.of(hemispheres, **axes),
        Node.of(open_triangles),
        Node.of(partial(known_open, settings.samples), "known_open"),
        *of_meshes,
        Node.of(partial(baked, values), "baked", **meshes),
        *_baked_nodes(scene, loaded, values, meshes),
        *nodes,
    ]


def _baked_nodes(scene: Scene, loaded: SceneFile, values: Files, meshes: Mapping[str, str]) -> list[Node]:
    """Nodes of w from files; only mesh files and images may have textures."""
    if not needs.may_have_occlusion_maps(scene):
        return [Node.of(baked_obscurance)]
    images = Images({}, partial(resolve, loaded))
    return [
        Node.of(partial(occlusion_maps, values, images), "occlusion_maps", **meshes),
        Node.of(mapped_obscurance, "baked_obscurance"),
    ]


def _obscurance_normals(scene: Scene) -> Node:
    """The axes of the hemispheres: the normals of shading points, where these are the samples."""
    rates = tuple(needs.rates(scene))
    if all(RATES[rate].at_samples for rate in rates):
        return Node.of(normals_of_points, "obscurance_normals")
    return Node.of(partial(obscurance_normals, rates), "obscurance_normals")


def _about_shading(scene: Scene) -> bool:
    """True if shading normals are the axes of the hemispheres of obscurance rays."""
    return (scene.obscurance or Obscurance()).about == "shading" and needs.is_smooth(scene)


def _camera_nodes(scene: Scene) -> list[Node]:
    """Nodes of the placements of cameras that fit an object."""
    numbers = {name: number for number, name in enumerate(scene.object_names())}

    return [
        Node.of(
            partial(framed, view.camera, view.width / view.height, numbers[view.camera.fit]),
            f"camera:{view.name}",
        )
        for view in needs.views(scene)
        if view.camera.fit is not None
    ]


def _reasons(scene: Scene, names: dict[str, Node]) -> dict[str, str]:
    """Why the scene itself makes buffers unnecessary, by buffer."""
    # Emission, ambient light and obscurance.
    reasons: dict[str, str] = {}
    traced = [
        "obscurance_draws",
        "obscurance_method",
        "view_method",
        "read_hits",
        "hemispheres",
        "known_open",
    ]
    if needs.reconstructs(scene):
        traced += ["raw_obscurance", "pixel_pairs", "object_pixels", FITTED]
    if not needs.is_emissive(scene):
        reasons |= dict.fromkeys(("emission", "emission_materials"), "no material emits")
    if not needs.is_ambient(scene):
        ambient = ("ambient", "ambient_color", "ambient_materials", "obscurance", *traced)
        reasons |= dict.fromkeys(ambient, "no surface reflects ambient light")
    if not _about_shading(scene) and scene.obscurance is not None:
        reasons["obscurance_normals"] = "obscurance rays are cast about the polygons' normals"
    if scene.obscurance is None:
        reasons |= dict.fromkeys(("obscurance", *traced), "the scene has no obscurance: w = 1")
    if any(needs.is_baked(scene)):
        reasons |= dict.fromkeys(traced, "the obscurance is baked")

    # Buffers of a light.
    lights = scene.named_lights()
    for name in names:
        kind, _, light_name = name.partition(":")
        light = lights.get(light_name) if light_name else None
        if kind in ("camera", "mesh") or light is None:
            continue
        if not needs.is_on(light):
            reasons[name] = "the light's intensity is 0"
        elif kind in ("shadow", "shadow_candidates") and not light.shadows:
            reasons[name] = "the light casts no shadows"
    return reasons
