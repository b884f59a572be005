"""Every buffer a scene could make, and from what: the wiring diagram. Nothing here runs anything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

from illumcli.demand import Recipe
from illumcli.errors import InputError
from illumcli.film.film import Layer
from illumcli.lights._base import Light
from illumcli.models._base import IlluminationModel
from illumcli.plan import stages
from illumcli.scene.spec import Obscurance, Scene, default_material
from illumcli.shading.terms import words
from illumcli.shading.textures import paths
from illumcli.variants import suggestion

SMOOTH = ("gouraud", "phong", "quadratic")


@dataclass(frozen=True, slots=True)
class View:
    """One picture: a camera and the size and sampling of its film."""

    name: str
    camera: Any
    width: int
    height: int
    samples: int


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
    lights = [Layer(name, f"light:{name}", _rgb(name)) for name in scene.named_lights()]
    shadows = [
        Layer(f"shadow.{name}", f"shadow:{name}", (f"shadow.{name}.Y",)) for name in scene.named_lights()
    ]
    known = {layer.name: [layer] for layer in [*lights, *shadows, *_LAYERS.values()]}
    known |= {"lights": lights, "shadows": shadows}
    problems = [f"no layer '{name}'; {suggestion(name, tuple(known))}" for name in names if name not in known]
    if problems:
        raise InputError(problems)
    return list({layer.name: layer for name in names for layer in known[name]}.values())


def _rgb(name: str) -> tuple[str, ...]:
    return tuple(f"{name}.{c}" for c in "RGB")


_LAYERS = {
    layer.name: layer
    for layer in (
        Layer("beauty", "beauty", ("R", "G", "B")),
        Layer("ambient", "ambient", _rgb("ambient")),
        Layer("diffuse", "diffuse", _rgb("diffuse")),
        Layer("specular", "specular", _rgb("specular")),
        Layer("emission", "emission", _rgb("emission")),
        Layer("obscurance", "obscurance", ("obscurance.Y",)),
        Layer("alpha", "alpha", ("A",)),
        Layer("depth", "depth", ("Z",), data=True),
        Layer("position", "world_position", ("P.X", "P.Y", "P.Z"), data=True),
        Layer("normal", "normal", ("N.X", "N.Y", "N.Z"), data=True),
        Layer("geometric_normal", "geometric_normal", ("Ng.X", "Ng.Y", "Ng.Z"), data=True),
        Layer("uv", "uv", ("uv.U", "uv.V"), data=True),
        Layer("object_id", "object_id", ("objectId.Y",), data=True),
        Layer("material_id", "material_id", ("materialId.Y",), data=True),
        Layer("triangle_id", "triangle_id", ("triangleId.Y",), data=True),
    )
}


def candidates(scene: Scene) -> list[IlluminationModel] | None:
    """The models that some surface may have; None where a mesh file's own library decides."""
    found: list[IlluminationModel] = []
    for thing in scene.objects:
        model = scene.material_of(thing)
        if model is not None:
            found.append(model)
            continue
        source = scene.meshes.get(thing.mesh) if isinstance(thing.mesh, str) else thing.mesh
        if getattr(source, "materials", False):
            return None
        found += [default_material(), *scene.materials.values()]
    return found


def reached_words(scene: Scene) -> frozenset[str]:
    """The words (`v`, `t`, ...) that some lobe of some candidate asks for."""
    models = candidates(scene)
    if models is None:
        return frozenset(("n", "l", "v"))
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


def active_lights(scene: Scene) -> dict[str, Light]:
    """The lights that send anything, by name."""
    return {name: light for name, light in scene.named_lights().items() if any(light.color())}


def recipes(scene: Scene, loaded: Any) -> dict[str, Recipe]:
    """Every buffer this scene could make, by name; `view` and `tile` are given."""
    rate = rates(scene)
    wanted = reached_words(scene)
    smooth = {"normals": "corner_normals"} if set(rate) & set(SMOOTH) else {}
    flat = {"centres": "polygon_centres", "polygon_normals": "polygon_normals"} if "constant" in rate else {}
    at_samples = not {"constant", "gouraud"} & set(rate)
    book = [
        Recipe.of(partial(stages.meshes, scene, loaded), "meshes"),
        Recipe.of(partial(stages.world, scene), "world"),
        Recipe.of(stages.tracer_over, "tracer"),
        Recipe.of(partial(stages.materials_of, scene, loaded), "materials"),
        Recipe.of(partial(stages.corner_normals, scene, rate), "corner_normals"),
        Recipe.of(stages.uvs),
        Recipe.of(stages.polygon_centres),
        Recipe.of(partial(stages.polygon_normals, scene), "polygon_normals"),
        Recipe.of(partial(stages.samples, scene.seed), "samples"),
        Recipe.of(partial(stages.rays, scene.film.filter), "rays"),
        Recipe.of(stages.hits),
        Recipe.of(stages.facets),
        Recipe.of(partial(stages.points, rate), "points", **smooth, **flat),
        Recipe.of(stages.material),
        Recipe.of(stages.view_vectors, "v"),
        Recipe.of(partial(stages.tangents, scene), "t"),
        Recipe.of(stages.shadow_origins, **smooth),
        Recipe.of(stages.obscurance_origins),
        Recipe.of(partial(stages.obscurance, scene.obscurance or Obscurance(), scene.seed), "obscurance"),
        Recipe.of(stages.ambient_color, **_varying(scene, "ambient")),
        Recipe.of(stages.emission, **_varying(scene, "emission")),
        Recipe.of(stages.alpha),
        Recipe.of(stages.depth),
        Recipe.of(stages.world_position),
        Recipe.of(stages.normal),
        Recipe.of(stages.geometric_normal),
        Recipe.of(stages.uv),
        Recipe.of(stages.object_id),
        Recipe.of(stages.material_id),
        Recipe.of(stages.triangle_id),
    ]
    images = cache(partial(stages.image, loaded))
    for purpose in ("lobes", "ambient", "emission"):
        if may_vary(scene, purpose):
            read, made = f"{purpose}_textures", f"{purpose}_parameters"
            book += [
                Recipe.of(partial(stages.textures, scene, images, purpose), read),
                Recipe.of(stages.parameters, made, textures=read),
            ]
    eye = {word: word for word in ("v", "t") if word in wanted} | _varying(scene, "lobes")
    for name, light in scene.named_lights().items():
        book += _light(name, light, eye, at_samples)
    return {recipe.makes: recipe for recipe in [*book, *_sums(scene)]}


def _varying(scene: Scene, purpose: str) -> dict[str, str]:
    """The need of a stage that asks for parameters that may vary."""
    return {"parameters": f"{purpose}_parameters"} if may_vary(scene, purpose) else {}


def _light(name: str, light: Light, eye: Mapping[str, str], at_samples: bool) -> list[Recipe]:
    """What one light takes: where it arrives, its shadow, the response to it."""
    lit, reach, shadow = f"lit:{name}", f"reach:{name}", f"shadow:{name}"
    if not any(light.color()):
        dark = partial(stages.black)
        return [Recipe.of(dark, f"light:{name}"), Recipe.of(partial(stages.no_shadow), shadow)]
    way = {"shadow": shadow} if light.shadows else {}
    return [
        Recipe.of(partial(stages.lit, light), lit),
        # where every model is evaluated at the samples, its lit points are those that want shadow rays
        Recipe.of(partial(stages.reach, light), reach)
        if not at_samples
        else Recipe.of(stages.same, reach, lit=lit),
        Recipe.of(stages.shadow, shadow, reach=reach)
        if light.shadows
        else Recipe.of(stages.no_shadow, shadow),
        Recipe.of(partial(stages.direct, light), f"direct:{name}", lit=lit, **eye),
        Recipe.of(stages.lobe_sum, f"light:{name}", direct=f"direct:{name}", **way),
        Recipe.of(partial(stages.one_lobe, "diffuse"), f"diffuse:{name}", direct=f"direct:{name}", **way),
        Recipe.of(partial(stages.one_lobe, "specular"), f"specular:{name}", direct=f"direct:{name}", **way),
        Recipe.of(partial(stages.arriving_light, light), f"unlit:{name}", lit=lit, **way),
    ]


def _sums(scene: Scene) -> list[Recipe]:
    """The pictures that are sums over lights, and the beauty."""
    lights = list(active_lights(scene))
    open_way = {"obscurance": "obscurance"} if scene.obscurance is not None else {}
    ambient = Recipe.of(partial(stages.ambient, scene.ambient.color), "ambient", **open_way)

    def total(makes: str, *parts: str) -> Recipe:
        return Recipe(makes, stages.total, {"hits": "hits", **{part: part for part in parts}})

    glow = ["emission"] if is_emissive(scene) else []
    if scene.ambient.form == "coupled":
        both = ["coupled"]
        needs = {"ambient_color": "ambient_color", "direct": "direct", "unlit": "unlit", **open_way}
        coupled = [Recipe("coupled", partial(stages.coupled, scene.ambient.color), needs)]
    else:
        both, coupled = (
            [*(["ambient"] if is_ambient(scene) else []), *(f"light:{name}" for name in lights)],
            [],
        )
    return [
        ambient,
        *coupled,
        total("direct", *(f"light:{name}" for name in lights)),
        total("unlit", *(f"unlit:{name}" for name in lights)),
        total("diffuse", *(f"diffuse:{name}" for name in lights)),
        total("specular", *(f"specular:{name}" for name in lights)),
        total("beauty", *glow, *both),
    ]
