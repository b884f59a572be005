"""Every buffer a scene could make, and from what: the wiring diagram. Nothing here runs anything."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from typing import Any

from illumcli.cache.fingerprint import FileFingerprint
from illumcli.errors import InputError
from illumcli.film.view import View, depth, rays, samples, view_vectors
from illumcli.graph import Node, topological_order
from illumcli.layers import FIXED, PER_LIGHT, Layer
from illumcli.lights import _incident as light_at
from illumcli.lights._base import Light
from illumcli.mesh_files import companions
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import Texture
from illumcli.records import Value
from illumcli.render_graph import stages
from illumcli.render_graph.replicates import error_recipes
from illumcli.scene.access import resolve
from illumcli.scene.spec import MeshFile, Normals, Object, Obscurance, Scene, default_material
from illumcli.schema.messages import suggestion
from illumcli.shading.materials import DEFAULT, Choice, Token
from illumcli.shading.rates import AT_SAMPLES
from illumcli.shading.terms import words
from illumcli.shading.textures import paths

GIVEN = ("view", "tile")
"""Buffers that need no recipe."""
PURPOSES = ("lobes", "ambient", "emission")
"""What parameters that vary over a surface may serve."""
SMOOTH = ("gouraud", "phong", "quadratic")


def views(scene: Scene) -> list[View]:
    """The scene's cameras with their films."""
    film = scene.film
    return [
        View(
            name,
            camera,
            camera.width or film.width,
            camera.height or film.height,
            camera.samples or film.samples,
            film.adaptive,
        )
        for name, camera in scene.named_cameras().items()
    ]


def layers(scene: Scene, names: Sequence[str]) -> list[Layer]:
    """The layers of these names: `lights` and `shadows` stand for one per light, which can be named alone.

    Raises
    ------
    InputError
        A name that is no layer of this scene.
    """
    per_light = {name: [of(light) for light in scene.named_lights()] for name, of in PER_LIGHT.items()}
    layers_of_lights = [layer for layers in per_light.values() for layer in layers]
    known = {layer.name: [layer] for layer in [*layers_of_lights, *FIXED.values()]} | per_light
    problems = [f"no layer '{name}'; {suggestion(name, tuple(known))}" for name in names if name not in known]
    if problems:
        raise InputError(problems)
    return list({layer.name: layer for name in names for layer in known[name]}.values())


def candidates(scene: Scene) -> list[IlluminationModel] | None:
    """The models that some surface may have; None where a mesh file's own library decides."""
    found: list[IlluminationModel] = []
    for thing in scene.objects:
        model = scene.material_of(thing)
        if model is not None:
            found.append(model)
            continue
        if imports(scene, thing):
            return None
        found += [default_material(), *scene.materials.values()]
    return found


def imports(scene: Scene, thing: Any) -> bool:
    """Does an object have the materials that its mesh file describes?"""
    wants = thing.fallback is not None or getattr(_source(scene, thing.mesh), "materials", False)
    return thing.material is None and bool(wants)


def reached_words(scene: Scene) -> frozenset[str]:
    """The words (`v`, `t`, ...) that some lobe of some candidate asks for."""
    models = candidates(scene)
    if models is None:  # libraries of meshes describe models that know of no tangent
        models = [*scene.materials.values(), *filter(None, map(scene.material_of, scene.objects))]
        return frozenset(("n", "l", "v")).union(*(words(model.lobes()) for model in models))
    return frozenset().union(*(words(model.lobes()) for model in models))


def rates(scene: Scene) -> list[str]:
    """The shading rate of each object."""
    return [thing.shading or scene.shading for thing in scene.objects]


def is_ambient(scene: Scene) -> bool:
    """Does any ambient light leave a surface?"""
    models = candidates(scene)
    if not any(scene.ambient.color):
        return False
    return models is None or any(_glows(model, model.ambient_color()) for model in models)


def weighs_ambient(scene: Scene) -> bool:
    """Is the ambient light weighed by obscurance, traced or baked?"""
    return scene.obscurance is not None or any(is_baked(scene))


def is_emissive(scene: Scene) -> bool:
    """Does any surface emit light?"""
    models = candidates(scene)
    return models is None or any(_glows(model, model.emission) for model in models)


def _glows(model: IlluminationModel, color: Any) -> bool:
    return not isinstance(color, tuple) or any(color)


def may_vary(scene: Scene, purpose: str) -> bool:
    """May a parameter that serves `purpose` (`lobes`, `ambient`, `emission`) vary over some surface?"""
    models = candidates(scene)
    return models is None or any(paths(model, purpose) for model in models)


def sends(light: Light) -> bool:
    """Does a light send anything?"""
    return any(light.color())


def active_lights(scene: Scene) -> dict[str, Light]:
    """The lights that send anything, by name."""
    return {name: light for name, light in scene.named_lights().items() if sends(light)}


class Known(Value):
    """A buffer of the whole scene that was computed or loaded before the graph is scheduled."""

    value: Any
    source: str = ""
    """Where it was loaded from, `memory` or `store`; nothing if it was computed in this run."""


class Graph(Value):
    """All nodes of a scene, by the buffer that each computes, and the views that they may be asked for."""

    scene: Scene
    views: tuple[View, ...]
    nodes: Mapping[str, Node] = field(repr=False)
    known: Mapping[str, Known] = field(default_factory=dict, repr=False)
    """Buffers that need no node any more."""
    loaders: Mapping[str, Node] = field(default_factory=dict, repr=False)
    """Nodes that load a buffer of one view instead of computing it."""
    culled: tuple[int, ...] = ()
    """Numbers of the objects that affect no view."""

    def topological_order(self, buffers: Iterable[str]) -> list[Node]:
        """The nodes that some buffers need, each after its inputs; loaders where there are some."""
        return topological_order({**self.nodes, **self.loaders}, buffers, GIVEN)

    def without_loaders(self) -> Graph:
        """The graph before cached buffers were substituted."""
        return replace(self, loaders={})


def build(scene: Scene, loaded: Any) -> Graph:
    """The graph of a scene. Reads no mesh, runs nothing.

    A node binds only those parts of the scene that its buffer depends on: they are its key in the cache
    (`render_graph.keys`). The buffers `view` and `tile` are given.
    """
    return Graph(scene, tuple(views(scene)), _nodes(scene, loaded))


def _nodes(scene: Scene, loaded: Any) -> dict[str, Node]:
    rate = rates(scene)
    wanted = reached_words(scene)
    smooth = {"normals": "corner_normals"} if set(rate) & set(SMOOTH) else {}
    flat = {"centres": "polygon_centres", "polygon_normals": "polygon_normals"} if "constant" in rate else {}
    # polygons that are flat by their normals need no weights where these alone are interpolated
    of_normals = {"corner_weights": "normal_weights" if set(rate) == {"phong"} else "corner_weights"}
    whole = {"planar_polygons": "planar_polygons"} if smooth or any(is_baked(scene)) else {}
    at_samples = AT_SAMPLES.issuperset(rate)
    grains = tuple(thing.grain for thing in scene.objects)
    by_uv = {name: name for name in ("uv_tangents", "point_weights")} if None in grains else {}
    book = [
        *_geometry(scene, loaded, rate),
        Node.of(stages.uvs),
        Node.of(stages.polygon_centres),
        Node.of(stages.planar_polygons),
        Node.of(stages.planar_polygons, "curved_polygons", normals="corner_normals"),
        Node.of(partial(samples, scene.seed), "samples"),
        Node.of(partial(rays, scene.film.filter), "rays"),
        Node.of(stages.hits),
        Node.of(stages.interaction),
        Node.of(stages.corner_weights, **whole),
        Node.of(stages.corner_weights, "normal_weights", planar_polygons="curved_polygons"),
        Node.of(partial(stages.points, rate), "points", **of_normals, **smooth, **flat),
        Node.of(stages.point_weights),
        Node.of(stages.material),
        Node.of(view_vectors, "v"),
        Node.of(stages.uv_tangents),
        Node.of(partial(stages.tangents, grains), "t", **by_uv),
        Node.of(stages.ray_origins),
        *_terminator(rate, smooth, of_normals),
        Node.of(partial(stages.obscurance_draws, scene.seed), "obscurance_draws"),
        Node.of(
            partial(stages.obscurance_normals, rate),
            "obscurance_normals",
            normals="corner_normals",
            **of_normals,
        ),
        *_obscurance(scene, loaded),
        Node.of(stages.ambient_color, **_varying(scene, "ambient")),
        Node.of(stages.emission, **_varying(scene, "emission")),
        Node.of(stages.alpha),
        Node.of(depth),
        Node.of(stages.world_position),
        Node.of(stages.normal),
        Node.of(stages.geometric_normal, planar_polygons="planar_polygons"),
        Node.of(stages.uv),
        Node.of(stages.object_id),
        Node.of(stages.material_id),
        Node.of(stages.triangle_id),
    ]
    book += _materials(scene, loaded)
    eye = {word: word for word in ("v", "t") if word in wanted} | _varying(scene, "lobes")
    implied = {"smooth": "smooth_surface"} if smooth and scene.terminator == "smooth" else {}
    for name, light in scene.named_lights().items():
        book += _light(name, light, eye, at_samples, implied)
    made = {recipe.output: recipe for recipe in [*book, *_sums(scene)]}
    counts = [view.samples for view in views(scene)]
    made |= {f"camera:{view.name}": recipe for view, recipe in _framings(scene)}
    return made | error_recipes(made, scene.seed, scene.film.background, counts, GIVEN)


def _framings(scene: Scene) -> list[tuple[View, Node]]:
    """The views that an object is to fill, and what makes their cameras."""
    numbers = {name: number for number, name in enumerate(scene.object_names())}
    return [
        (
            view,
            Node.of(
                partial(stages.framed, view.camera, view.width / view.height, numbers[view.camera.fit]),
                f"camera:{view.name}",
            ),
        )
        for view in views(scene)
        if view.camera.fit is not None
    ]


def _obscurance(scene: Scene, loaded: Any) -> list[Node]:
    """w, by rays or from the files that its objects' meshes name."""
    files = baked_files(scene, loaded)
    settings = scene.obscurance or Obscurance()
    more = {"open_triangles": "open_triangles"}
    if any(file for _, file in files):
        more |= {"baked": "baked", "corner_weights": "corner_weights"}
    if settings.faces != "count":
        more["triangle_normals"] = "triangle_normals"
    if settings.about == "shading" and set(rates(scene)) & set(SMOOTH):
        more["obscurance_normals"] = "obscurance_normals"
    if all_baked(scene) or (scene.obscurance is None and "baked" in more):
        w = Node.of(stages.baked_or_open, "obscurance")
    else:
        w = Node.of(partial(stages.obscurance, settings), "obscurance", **more)
    return [
        Node.of(stages.open_triangles),
        Node.of(stages.triangle_normals),
        Node.of(partial(stages.baked, files), "baked"),
        w,
    ]


def baked_files(scene: Scene, loaded: Any) -> tuple[tuple[str, FileFingerprint | None], ...]:
    """Name of each object and the file of its baked obscurance."""
    sources = [_source(scene, thing.mesh) for thing in scene.objects]
    files = [source.obscurance if isinstance(source, MeshFile) else None for source in sources]
    return tuple(
        (name, None if file is None else FileFingerprint(partial(resolve, loaded, file)))
        for name, file in zip(scene.object_names(), files, strict=True)
    )


def is_baked(scene: Scene) -> list[bool]:
    """Of each object: does its mesh name baked obscurance?"""
    return [getattr(_source(scene, thing.mesh), "obscurance", None) is not None for thing in scene.objects]


def all_baked(scene: Scene) -> bool:
    """Is there no surface left to cast obscurance rays from?"""
    return bool(scene.objects) and all(is_baked(scene))


def _geometry(scene: Scene, loaded: Any, rate: Sequence[str]) -> list[Node]:
    """Meshes, each source once, what is made of them all, and their normals."""
    sources = [_source(scene, thing.mesh) for thing in scene.objects]
    found = {
        mesh_name(scene, thing.mesh): source for thing, source in zip(scene.objects, sources, strict=True)
    }
    names = list(found)
    which = tuple(names.index(mesh_name(scene, thing.mesh)) for thing in scene.objects)
    normals = tuple(source.normals if isinstance(source, MeshFile) else None for source in sources)
    how = tuple("flat" if own == "constant" else said for own, said in zip(rate, normals, strict=True))
    methods = tuple("newell" if said is None else said.polygon for said in normals)
    parts = {f"mesh{k}": f"mesh:{name}" for k, name in enumerate(names)}
    by_file = tuple(said is None or said.source == "file" for said in normals)
    flat = tuple(own == "constant" or scene.terminator == "none" for own in rate)
    called = tuple(
        source.file if isinstance(source, MeshFile) else f"object {name}"
        for source, name in zip(sources, scene.object_names(), strict=True)
    )
    computes = tuple(
        own != "constant" and _computes_normals(source) for own, source in zip(rate, sources, strict=True)
    )
    selects = tuple(
        None
        if scene.material_of(thing) is not None
        else (() if thing.fallback is not None else tuple(sorted(scene.materials)), imports(scene, thing))
        for thing in scene.objects
    )
    wants = tuple(_wants_direction(scene, thing) for thing in scene.objects)
    return [
        *(Node.of(partial(stages.mesh, _read(loaded, found[name])), f"mesh:{name}") for name in names),
        Node("meshes", partial(stages.meshes, which), parts),
        Node.of(
            partial(stages.object_bounds, tuple(thing.transform for thing in scene.objects)),
            "object_bounds",
        ),
        Node.of(partial(stages.implied_widths, flat), "implied_widths"),
        Node.of(partial(stages.geometry, by_file), "geometry"),
        Node.of(stages.render_space),
        Node.of(partial(stages.repairs, called, computes), "repairs"),
        *([Node.of(partial(stages.undirected, called, wants), "undirected")] if any(wants) else []),
        *([Node.of(partial(stages.unnamed, called, selects), "unnamed")] if any(selects) else []),
        Node.of(stages.tracer_over, "tracer"),
        Node.of(partial(stages.corner_normals, how), "corner_normals"),
        Node.of(partial(stages.polygon_normals, methods), "polygon_normals"),
    ]


def _computes_normals(source: Any) -> bool:
    """Does the description of a mesh file say how normals are made, but not that all are?"""
    if not isinstance(source, MeshFile) or source.normals.source != "file":
        return False
    own, usual = source.normals, Normals()
    return (own.crease, own.weights) != (usual.crease, usual.weights)


def _wants_direction(scene: Scene, thing: Object) -> bool:
    """Has an object's own material a grain that only uv can direct?"""
    model = scene.material_of(thing)
    return thing.grain is None and model is not None and model.has_grain()


def _source(scene: Scene, mesh: Any) -> Any:
    """The description of an object's mesh."""
    if isinstance(mesh, str):
        return scene.meshes[mesh] if mesh in scene.meshes else MeshFile(file=mesh)
    return mesh


def mesh_name(scene: Scene, mesh: Any) -> str:
    """What an object's mesh is called: by its file, else by its name, else by its description."""
    source = _source(scene, mesh)
    if isinstance(source, MeshFile):
        return source.file if "." in source.file else f"./{source.file}"  # apart from names
    return mesh if isinstance(mesh, str) else repr(source)


def _read(loaded: Any, source: Any) -> Any:
    """What a mesh is made from: the content of its file, or the shape."""
    if not isinstance(source, MeshFile):
        return source
    return FileFingerprint(partial(resolve, loaded, source.file), companions)


def _materials(scene: Scene, loaded: Any) -> list[Node]:
    """Numbers of materials, their models, and what these vary by."""
    choices: list[Choice] = []
    models: dict[Token, Any] = {DEFAULT: default_material()}
    for thing, name in zip(scene.objects, scene.object_names(), strict=True):
        model = scene.material_of(thing)
        of_scene = isinstance(thing.material, str) and not thing.override
        token: Token = ("material", str(thing.material)) if of_scene else ("object", name)
        if model is not None:
            models[token] = model
        fallback: Token | None = None
        if (other := scene.fallback_of(thing)) is not None:
            fallback = ("material", thing.fallback) if isinstance(thing.fallback, str) else ("fallback", name)
            models[fallback] = other
        library = mesh_name(scene, thing.mesh) if imports(scene, thing) else None
        choices.append(Choice(None if model is None else token, library, fallback))
    imported = tuple(choice.library for choice in choices)
    if any(choice.own is None for choice in choices):  # a mesh may select any material of the scene
        models |= {("material", name): model for name, model in scene.materials.items()}
    files = {model.file for model in models.values() if hasattr(model, "file")}
    measured = {file: FileFingerprint(partial(resolve, loaded, file)) for file in sorted(files)}
    numbering = partial(stages.numbering, tuple(choices), tuple(sorted(scene.materials)))
    own = {"meshes": "meshes"} if any(imported) else {}
    book = [
        Node.of(numbering, "numbering"),
        Node.of(partial(stages.materials_of, models, measured, imported), "materials", **own),
    ]
    named = sorted({each.texture for each in _varied(models.values()) if isinstance(each, Texture)})
    images = stages.Images({path: FileFingerprint(partial(resolve, loaded, path)) for path in named}, loaded)
    for purpose in PURPOSES:
        if may_vary(scene, purpose):
            read, made = f"{purpose}_textures", f"{purpose}_parameters"
            book += [
                Node.of(partial(stages.textures, scene.object_names(), images, purpose), read),
                Node.of(stages.parameters, made, textures=read),
            ]
    return book


def _varied(models: Iterable[IlluminationModel]) -> list[Any]:
    """Everything that some parameter varies by."""
    return [each for model in models for each in model.varying().values()]


def _varying(scene: Scene, purpose: str) -> dict[str, str]:
    """The need of a stage that asks for parameters that may vary."""
    return {"parameters": f"{purpose}_parameters"} if may_vary(scene, purpose) else {}


def _terminator(rate: Sequence[str], smooth: Mapping[str, str], weights: Mapping[str, str]) -> list[Node]:
    """The surface that normals imply, from which shadow rays start; none where every object is flat."""
    if not smooth:
        return []
    surface = partial(stages.smooth_surface, tuple(own == "constant" for own in rate))
    return [
        Node.of(stages.smooth_parts, **smooth),
        Node.of(surface, "smooth_surface", **smooth, **weights),
    ]


def _light(
    name: str, light: Light, eye: Mapping[str, str], at_samples: bool, implied: Mapping[str, str]
) -> list[Node]:
    """What one light takes: where it arrives, its shadow, the response to it.

    `implied` names the smooth surface that shadow rays may start from, if there is one.
    """
    incident, candidates, shadow = f"incident:{name}", f"shadow_candidates:{name}", f"shadow:{name}"
    if not sends(light):
        dark = partial(stages.black)
        return [Node.of(dark, f"light:{name}"), Node.of(partial(stages.no_shadow), shadow)]
    place = light.without_color()
    color = light.color()
    way = {"shadow": shadow} if light.shadows else {}
    arriving = incident
    opened = []
    if at_samples and light.shadows:  # what lies in shadow is not evaluated at all
        arriving, way = f"unshadowed:{name}", {}
        opened = [Node.of(partial(light_at.unshadowed, place), arriving, shadow=shadow)]
    return [
        *opened,
        Node.of(partial(light_at.incident, place), incident),
        # where every model is evaluated at the samples, the lit ones are those that want shadow rays
        *([] if at_samples else [Node.of(partial(light_at.shadow_candidates, place), candidates)]),
        Node.of(stages.shadow, shadow, shadow_candidates=incident if at_samples else candidates, **implied)
        if light.shadows
        else Node.of(stages.no_shadow, shadow),
        Node.of(partial(stages.direct, color), f"direct:{name}", incident=arriving, **eye),
        Node.of(stages.sum_lobes, f"light:{name}", direct=f"direct:{name}", **way),
        Node.of(partial(stages.one_lobe, "diffuse"), f"diffuse:{name}", direct=f"direct:{name}", **way),
        Node.of(partial(stages.one_lobe, "specular"), f"specular:{name}", direct=f"direct:{name}", **way),
        Node.of(partial(stages.irradiance, color), f"irradiance:{name}", incident=arriving, **way),
    ]


def _sums(scene: Scene) -> list[Node]:
    """The pictures that are sums over lights, and the beauty."""
    lights = list(active_lights(scene))
    open_way = {"obscurance": "obscurance"} if weighs_ambient(scene) else {}
    ambient = Node.of(partial(stages.ambient, scene.ambient.color), "ambient", **open_way)

    def total(makes: str, *parts: str) -> Node:
        return Node(makes, stages.total, {"hits": "hits", **{part: part for part in parts}})

    glow = ["emission"] if is_emissive(scene) else []
    if scene.ambient.form == "coupled":
        both = ["coupled"]
        needs = {"ambient_color": "ambient_color", "direct": "direct", "irradiance": "irradiance", **open_way}
        coupled = [Node("coupled", partial(stages.coupled, scene.ambient.color), needs)]
    else:
        both, coupled = (
            [*(["ambient"] if is_ambient(scene) else []), *(f"light:{name}" for name in lights)],
            [],
        )
    if scene.depth_cue is not None:
        cued = [Node.of(partial(stages.depth_cued, scene.depth_cue), "beauty")]
    else:
        cued = []
    return [
        ambient,
        *coupled,
        total("direct", *(f"light:{name}" for name in lights)),
        total("irradiance", *(f"irradiance:{name}" for name in lights)),
        total("diffuse", *(f"diffuse:{name}" for name in lights)),
        total("specular", *(f"specular:{name}" for name in lights)),
        total("uncued" if cued else "beauty", *glow, *both),
        *cued,
    ]


SHAPE = ("object_id", "geometric_normal")
"""Buffers whose differences say, before any light, which pixels want more samples."""
