"""Keys of a scene that have no effect beside the rest of it, with the way out.

Not reported: arithmetic (a light of intensity 0), what no requested layer shows, and materials, meshes or
cameras that nothing names, since scenes share them by `extends`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from illumcli.models._parameters import Texture
from illumcli.scene.faults import Fault
from illumcli.scene.source import Path
from illumcli.scene.spec import MeshFile, Object, Scene
from illumcli.schema.annotations import annotation_at, number_range
from illumcli.shading.rates import RATES


def unused(scene: Scene, layers: Collection[str], files: Collection[str]) -> Iterator[Fault]:
    """Path and message of each key that has no effect; keys that the scene leaves at their default included.

    Parameters
    ----------
    layers : collection of str
        Layers that are rendered.
    files : collection of str
        Name patterns of the files that are written; none if the scene's own are not used.
    """
    yield from _views(scene)
    yield from _ambient(scene, layers)
    yield from _meshes(scene)
    for i, (thing, (_, source)) in enumerate(zip(scene.objects, _sources(scene), strict=True)):
        yield from _object(scene, i, thing, source)
    if scene.objects and all(thing.shading for thing in scene.objects):
        yield ("shading",), "is not used, every object has a rate of its own; change theirs"
    if files and all(name.lower().endswith(".png") for name in files):
        yield ("outputs", "colour"), "is not used, it is the precision of .exr; write one, or leave it out"


def lacking(scene: Scene, layers: Collection[str]) -> Iterator[Fault]:
    """Path and message of the part that is missing if an image would be empty or black."""
    if not scene.objects:
        yield ("objects",), "the scene has none, its pictures are empty; add objects: [{mesh: FILE}]"
    elif not scene.lights and not any(scene.ambient.color) and LIT & set(layers) and not _may_emit(scene):
        fact = "the scene has none and no ambient light, its pictures are black; add lights, or ambient: 0.5"
        yield ("lights",), fact


LIT = {"beauty", "ambient", "diffuse", "specular"}
"""Layers that are black without light."""


def _may_emit(scene: Scene) -> bool:
    """True if some surface may emit light."""
    for (_, source), thing in zip(_sources(scene), scene.objects, strict=True):
        material = scene.material_of(thing)
        if material is None and (thing.fallback is not None or getattr(source, "materials", False)):
            return True
        models = scene.materials.values() if material is None else [material]
        if any(model.emission != (0.0, 0.0, 0.0) for model in models):
            return True
    return False


def _views(scene: Scene) -> Iterator[Fault]:
    """Keys of cameras and of the film."""
    film, cameras = scene.film, scene.named_cameras()
    for name, camera in cameras.items():
        path: Path = ("cameras", name) if scene.cameras else ("camera",)
        if camera.fit is not None:
            yield (*path, "extent"), "is not used, fit says how much is seen; leave one of them out"
        if _parallel(camera.up, [b - a for a, b in zip(camera.position, camera.target, strict=True)]):
            yield (*path, "up"), "is not used, it lies along the line of sight; give another direction"
    for key in ("width", "height", "samples"):
        if all(getattr(camera, key) for camera in cameras.values()):
            yield ("film", key), f"is not used, every camera has its own {key}; change theirs"
    samples = [camera.samples or film.samples for camera in cameras.values()]
    if max(samples) == 1:
        if film.adaptive:
            yield ("film", "adaptive"), "is not used, no pixel has more than one sample; raise film.samples"
        yield ("film", "filter"), "is not used, a single sample looks through the pixel's centre; take more"


def _parallel(a: Any, b: Any) -> bool:
    """True if two vectors have the same or opposite directions, within a camera's tolerance."""
    a, b = ([x / max(map(abs, vector)) for x in vector] for vector in (a, b))
    cross = [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    size = sum(x * x for x in a) * sum(x * x for x in b)
    return sum(x * x for x in cross) < 1e-18 * size


def _ambient(scene: Scene, layers: Collection[str]) -> Iterator[Fault]:
    """Obscurance where there is no ambient light, or where all values are baked."""
    sources = [source for _, source in _sources(scene)]
    baked = [isinstance(source, MeshFile) and source.obscurance is not None for source in sources]
    if baked and all(baked):
        yield ("obscurance",), "is not used, every mesh has baked values; leave it or theirs out"
    if scene.ambient.form == "separate" and not any(scene.ambient.color) and "obscurance" not in layers:
        fact = "is not used, there is no ambient light for it to weigh; give ambient a colour"
        yield ("obscurance",), fact
        for path, _ in _sources(scene):
            yield (*path, "obscurance"), fact


def _sources(scene: Scene) -> list[tuple[Path, Any]]:
    """Where each object's mesh is described, and its description."""
    return [
        (("meshes", thing.mesh), scene.meshes.get(thing.mesh))
        if isinstance(thing.mesh, str)
        else (("objects", i, "mesh"), thing.mesh)
        for i, thing in enumerate(scene.objects)
    ]


def _meshes(scene: Scene) -> Iterator[Fault]:
    """Keys of mesh files that no object with the mesh uses."""
    users: dict[Path, list[Object]] = {}
    for (path, source), thing in zip(_sources(scene), scene.objects, strict=True):
        if isinstance(source, MeshFile):
            users.setdefault(path, []).append(thing)
    for path, things in users.items():
        # Materials of the file, and normals.
        if all(thing.material is not None for thing in things):
            fact = "is not used, its objects have materials of their own; leave these, or this, out"
            yield (*path, "materials"), fact
        rates = {thing.shading or scene.shading for thing in things}
        if not any(RATES[rate].is_smooth for rate in rates):
            for key in ("source", "weights", "crease"):
                fact = f"is not used, the rate {min(rates)} shades by polygons' own normals; leave it out"
                yield (*path, "normals", key), fact


def _object(scene: Scene, number: int, thing: Object, source: Any) -> Iterator[Fault]:
    """Keys of one object and of its material; `source` describes its mesh."""
    # Grain, fallback, override and transform.
    path: Path = ("objects", number)
    model = scene.material_of(thing)
    if model is not None and model.isotropic and not model.has_grain():
        yield (*path, "grain"), f"is not used, the model {dict(model)['model']} has none; leave it out"
    if thing.material is not None:
        yield (*path, "fallback"), "is not used, the object has a material of its own; leave one of them out"
    if thing.override and thing.material is None and (thing.fallback or getattr(source, "materials", False)):
        fact = "replaces all that the mesh file selects by one material; give the object a material"
        yield (*path, "override"), fact
    x, y, z = thing.transform.scale
    if thing.transform.fit is not None and x == y == z > 0:
        yield (*path, "transform", "scale"), "is not used, fit says the size; leave one of them out"

    # Channels of textures that are read as colours.
    if model is not None:
        written = ("materials", thing.material) if isinstance(thing.material, str) else (*path, "material")
        for where in (written, (*path, "override")):
            for name in _colored_by(model):
                fact = "is not used, a colour reads r, g and b; leave it out"
                yield (*where, *name.split("."), "channel"), fact


def _colored_by(model: Any) -> Iterator[str]:
    """Paths of the colours of a model that vary by an image."""
    for name, value in model.varying().items():
        if isinstance(value, Texture) and number_range(annotation_at(model, name)).width == 3:
            yield name
