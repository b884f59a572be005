"""Nodes of meshes, of the scene's geometry and normals, and of repairs."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from illumcli.cache.fingerprint import FileFingerprint, FileFingerprints
from illumcli.geometry.bounds import implied_widths
from illumcli.geometry.scene_geometry import (
    bounds_of,
    corner_normals,
    polygon_normals,
    scene_geometry,
)
from illumcli.geometry.scene_repairs import repairs, undirected, unnamed
from illumcli.geometry.shapes._base import Shape
from illumcli.graph import Node
from illumcli.mesh_files import companions, is_mesh_file
from illumcli.rays.embree import tracer
from illumcli.rays.embree_library import embree_library
from illumcli.render_graph import needs, stages
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import MeshFile, Normals, Object, Scene
from illumcli.shading.rates import RATES


def geometry_nodes(
    scene: Scene, loaded: SceneFile, files: FileFingerprints, shares_meshes: bool
) -> list[Node]:
    """Nodes of meshes, and of everything computed from all of them.

    Objects with equal meshes share one if `shares_meshes`, and if Embree's library is there: embreex alone
    knows no instances.
    """
    transforms = tuple(thing.transform for thing in scene.objects)
    rates = needs.rates(scene)
    flat = tuple(not RATES[rate].is_smooth or scene.terminator == "none" for rate in rates)
    return [
        *_mesh_nodes(scene, loaded, files),
        Node.of(partial(bounds_of, transforms), "object_bounds"),
        Node.of(partial(implied_widths, flat), "implied_widths"),
        Node.of(stages.render_space),
        *_normal_nodes(scene, shares_meshes),
        Node.of(tracer),
        *_repair_nodes(scene),
    ]


def _mesh_nodes(scene: Scene, loaded: SceneFile, files: FileFingerprints) -> list[Node]:
    """One node per mesh file or shape, and the node of every object's mesh."""
    of_object = [needs.mesh_name(scene, thing.mesh) for thing in scene.objects]
    sources = {name: source for name, (_, source) in zip(of_object, _sources(scene), strict=True)}
    number = {name: k for k, name in enumerate(sources)}
    which = tuple(number[name] for name in of_object)
    parts = {f"mesh{k}": f"mesh:{name}" for name, k in number.items()}
    meshes = [
        Node.of(partial(stages.mesh, _content(loaded, files, source)), f"mesh:{name}")
        for name, source in sources.items()
    ]
    return [*meshes, Node("meshes", partial(stages.meshes, which), parts)]


def _normal_nodes(scene: Scene, shares_meshes: bool) -> list[Node]:
    """Nodes of all triangles and their normals."""
    says = [source.normals if isinstance(source, MeshFile) else None for _, source in _sources(scene)]
    by_file = tuple(each is None or each.source == "file" for each in says)
    smooth = [RATES[rate].is_smooth for rate in needs.rates(scene)]
    how = tuple(each if curved else "flat" for curved, each in zip(smooth, says, strict=True))
    methods = tuple("newell" if each is None else each.polygon for each in says)
    # Objects that have one mesh, with normals computed in one way, may share it at any shading rate.
    names = [needs.mesh_name(scene, thing.mesh) for thing in scene.objects]
    number: dict[tuple[str, str], int] = {}
    texts = {key: repr(each) for key, each in {id(each): each for each in says}.items()}
    kinds = tuple(
        number.setdefault((name, texts[id(each)]), len(number))
        for name, each in zip(names, says, strict=True)
    )
    if len(number) == len(kinds) or not shares_meshes or embree_library() is None:
        kinds = tuple(range(len(kinds)))
    return [
        Node.of(partial(scene_geometry, by_file, kinds), "geometry"),
        Node.of(partial(corner_normals, how), "corner_normals"),
        Node.of(partial(polygon_normals, methods), "polygon_normals"),
    ]


def _repair_nodes(scene: Scene) -> list[Node]:
    """Nodes of the repairs of meshes, and of data that materials need and meshes lack."""
    # Which repairs each object may need.
    rates, sources = needs.rates(scene), [source for _, source in _sources(scene)]
    names = tuple(
        source.file if isinstance(source, MeshFile) else f"object {name}"
        for source, name in zip(sources, scene.object_names(), strict=True)
    )
    computes = tuple(
        RATES[rate].is_smooth and _computes_normals(source)
        for rate, source in zip(rates, sources, strict=True)
    )
    by_uv = tuple(_needs_uv_direction(scene, thing) for thing in scene.objects)
    selects = tuple(_selects(scene, thing) for thing in scene.objects)

    nodes = [Node.of(partial(repairs, names, computes), "repairs")]
    if any(by_uv):
        nodes.append(Node.of(partial(undirected, names, by_uv), "undirected"))
    if any(selects):
        nodes.append(Node.of(partial(unnamed, names, selects, tuple(needs.is_baked(scene))), "unnamed"))
    return nodes


def _sources(scene: Scene) -> list[tuple[Object, MeshFile | Shape]]:
    """Every object with the description of its mesh."""
    return [(thing, needs.source_of(scene, thing.mesh)) for thing in scene.objects]


def _content(loaded: SceneFile, files: FileFingerprints, source: MeshFile | Shape) -> FileFingerprint | Shape:
    """The source of a mesh: the fingerprint of its file, or the shape."""
    if not isinstance(source, MeshFile):
        return source
    return files.of(source.file, partial(resolve, loaded), companions)


def _computes_normals(source: MeshFile | Shape) -> bool:
    """True if a mesh file's description sets how normals are computed, but the file's normals are used."""
    if not isinstance(source, MeshFile) or source.normals.source != "file":
        return False
    normals, defaults = source.normals, Normals()
    return (normals.crease, normals.weights) != (defaults.crease, defaults.weights)


def _needs_uv_direction(scene: Scene, thing: Object) -> bool:
    """True if an object's material is anisotropic and only uv can give it a direction."""
    model = scene.material_of(thing)
    return thing.grain is None and model is not None and model.has_grain()


def _selects(scene: Scene, thing: Object) -> tuple[tuple[str, ...], bool] | None:
    """The scene's materials that an object's mesh may select, and whether it has those of its file; None if
    the object has one material."""
    if scene.material_of(thing) is not None:
        return None
    named = () if thing.fallback is not None else tuple(sorted(scene.materials))
    return named, needs.imports(scene, thing)


def baked_files(
    scene: Scene, loaded: SceneFile, files: FileFingerprints
) -> tuple[tuple[str, FileFingerprint | None], ...]:
    """The name of each object and the file of its baked obscurance, if any."""
    paths = [source.obscurance if isinstance(source, MeshFile) else None for _, source in _sources(scene)]
    return tuple(
        (name, None if path is None else files.of(path, partial(resolve, loaded), companions))
        for name, path in zip(scene.object_names(), paths, strict=True)
    )


def baked_mesh_nodes(scene: Scene, loaded: SceneFile, files: FileFingerprints) -> tuple[Node, ...]:
    """Nodes of the mesh files that hold the obscurance of objects, and of the file of each object; none if no
    object has one."""
    paths = [source.obscurance if isinstance(source, MeshFile) else None for _, source in _sources(scene)]
    names = [path if path is not None and is_mesh_file(Path(path)) else None for path in paths]
    number = {name: k for k, name in enumerate(dict.fromkeys(name for name in names if name is not None))}
    if not number:
        return ()
    which = tuple(None if name is None else number[name] for name in names)
    of_file = {name: f"mesh:{needs.mesh_name(scene, MeshFile(file=name))}" for name in number}
    nodes = [
        Node.of(partial(stages.mesh, _content(loaded, files, MeshFile(file=name))), output)
        for name, output in of_file.items()
    ]
    parts = {f"mesh{k}": of_file[name] for name, k in number.items()}
    return *nodes, Node("obscurance_meshes", partial(stages.obscurance_meshes, which), parts)
