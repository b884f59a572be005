"""Relations of ways to run and to write the same scene."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np

from illumcli.cache import policy as artifacts
from illumcli.cache.memory import MemoryCache
from illumcli.cache.store import Store
from illumcli.commands import render
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.sweep import sweep_scene
from illumcli.compiled import SWITCH
from illumcli.images.reader import read_image
from illumcli.render_graph.execute import Run, at_pixels, run_once
from illumcli.scene.load import load
from illumcli.scene.variants import Variant
from metamorphic.pictures import ALL, Pictures, Studio, close, light_layers, pictures, same
from metamorphic.premises import UNDRAWN, at_centres, fixed_samples, one_camera, without_rays
from metamorphic.relation import relation
from metamorphic.scenes import MEASUREMENT, Case
from planned import planned


@relation("exact")
def a_layer_does_not_know_of_others(case: Case, random: Random, studio: Studio) -> None:
    """A layer is the same whatever is asked for beside it: `triangle_id` keeps objects that are left out
    otherwise, `error` renders some pixels twice, adaptive samples are each layer's own."""
    path = case.write(studio.folder())
    every = (*ALL, *light_layers(case), *(f"shadow.{name}" for name in light_layers(case)))
    more = ("triangle_id", "error")
    whole = pictures(path, layers=(*every, *more))
    light = [name for name in every if name != "obscurance"]  # whose rays reach far in most scenes
    asked = [random.sample(names, random.randint(1, 4)) for names in (every, light, light)]
    for part in (pictures(path, layers=names) for names in (*asked, every)):
        same({key: whole[key] for key in part}, part)


@relation("exact")
def tiles_and_threads_change_nothing(case: Case, random: Random, studio: Studio) -> None:
    """Tiles of any size on any number of threads are the same picture."""
    path = case.write(studio.folder())
    layers = (*ALL, "triangle_id", *light_layers(case))
    side = random.choice([4, 7, 16, 24])
    same(
        pictures(path, layers=layers), pictures(path, layers=layers, threads=random.randint(1, 3), side=side)
    )


@relation("exact")
def loops_in_c_change_nothing(case: Case, random: Random, studio: Studio) -> None:
    """Without the compiled loops every pixel is the same, also where obscurance is reconstructed."""
    path = case.write(studio.folder())
    layers = (*ALL, "triangle_id", *light_layers(case))
    reconstructed = ["obscurance.reconstruct=true"] if "obscurance" in case.scene else []
    overrides = random.choice([[], reconstructed])
    compiled = pictures(path, overrides, layers)
    with patch.dict(os.environ, {SWITCH: "0"}):
        same(compiled, pictures(path, overrides, layers))


@relation("exact")
def a_crop_is_part_of_the_whole(case: Case, random: Random, studio: Studio) -> None:
    """Some pixels alone are those of the whole picture. Premise: fixed samples."""
    case = one_camera(fixed_samples(case))
    path = case.write(studio.folder())
    loaded = load(path)
    layers = (*ALL, "triangle_id", *light_layers(case))
    whole = pictures(path, layers=layers)
    steps = planned(loaded, layers)
    view = steps.view
    x0, y0 = random.randrange(view.width), random.randrange(view.height)
    x1, y1 = random.randint(x0 + 1, view.width), random.randint(y0 + 1, view.height)
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)))
    part = at_pixels(steps, run_once(steps, Run()), Run(), x, y)
    shape = (y1 - y0, x1 - x0, -1)
    same(
        {key: np.ascontiguousarray(values[y0:y1, x0:x1]) for key, values in whole.items()},
        {(view.name, layer): values.reshape(shape) for layer, values in part.items()},
    )


@relation("rounding")
def half_the_view_is_its_middle(case: Case, random: Random, studio: Studio) -> None:
    """A view half as wide and high on half the pixels is the middle of the whole. Premises: one sample per
    pixel, no obscurance, whose rays are drawn by pixel number; sizes that fours divide."""
    case = without_rays(at_centres(case))
    half = case.copy()
    half.scene["film"] |= {"width": 12, "height": 8}
    for camera, narrow in zip(case.scene["cameras"].values(), half.scene["cameras"].values(), strict=True):
        for each in (camera, narrow):
            each.pop("width", None)
            each.pop("height", None)
        if "extent" in narrow:
            narrow["extent"] /= 2
        else:
            narrow["fov"] = math.degrees(2 * math.atan(math.tan(math.radians(narrow["fov"]) / 2) / 2))
    layers = (*UNDRAWN, *light_layers(case))
    middle = {key: values[4:12, 6:18] for key, values in studio(case, layers).items()}
    close(middle, studio(half, layers), share=1e-3)


@relation("exact")
def each_view_is_a_scene(case: Case, random: Random, studio: Studio) -> None:
    """A scene of several cameras is as many scenes."""
    whole = studio(case)
    for name, camera in case.scene["cameras"].items():
        own = case.copy()
        own.scene["cameras"] = {name: camera}
        same({key: values for key, values in whole.items() if key[0] == name}, studio(own))


@relation("exact")
def an_adaptive_pixel_has_one_sample_or_all(case: Case, random: Random, studio: Studio) -> None:
    """Every pixel of an adaptive picture is that of all samples, or that of one with the rays of all."""
    case = fixed_samples(case)
    for camera in case.scene["cameras"].values():
        camera.pop("samples", None)

    def sampled(rays: int = 1, **film: Any) -> Pictures:
        own = case.copy()
        own.scene["film"] |= film
        settings = own.scene.get("obscurance") or {"samples": 4}
        own.scene["obscurance"] = settings | {"samples": rays * settings.get("samples", 64)}
        return studio(own, layers)

    layers = (*ALL, *light_layers(case))
    many = random.choice([2, 3, 6])
    first, every = sampled(samples=1, rays=many), sampled(samples=many)
    for key, values in sampled(samples=many, adaptive=random.choice([True, {"probes": 1}])).items():
        agrees = [(values == other[key]).all(axis=-1) for other in (first, every)]
        neither = ~(agrees[0] | agrees[1])
        assert not neither.any(), f"{key}: {int(neither.sum())} pixels have neither one sample nor {many}"


@relation("exact")
def what_is_kept_is_what_is_made(case: Case, random: Random, studio: Studio) -> None:
    """A store and a memory filled by this scene and by changed ones change no pixel of it."""
    case = case.copy()
    folder = studio.folder()
    path = case.write(folder)
    layers = (*ALL, *light_layers(case))
    changes = [change(case, random) for _ in range(3)]
    fresh = [pictures(path, overrides, layers) for overrides in changes]
    store, memory = Store(folder / "cache", 1 << 26), MemoryCache()
    with patch.object(artifacts, "worth", lambda seconds, size: True):
        for overrides, made in zip([*changes, *changes], [*fresh, *fresh], strict=True):
            kept = random.random() < 0.7
            same(made, pictures(path, overrides, layers, store=store, memory=memory if kept else None))
            memory.retire()
    store.finish()


def leaves(part: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """The numbers and vectors of a scene with their paths: what a change may scale down and stay valid."""
    is_vector = isinstance(part, list) and len(part) == 3 and all(isinstance(x, float) for x in part)
    if isinstance(part, float) or is_vector:
        yield path, part
    elif isinstance(part, dict | list):
        for step in part if isinstance(part, dict) else range(len(part)):
            yield from leaves(part[step], (*path, step))


def change(case: Case, random: Random) -> list[str]:
    """Up to three overrides that make numbers of the scene smaller."""
    places = [
        (path, value)
        for path, value in leaves(case.scene)
        if "vertices" not in path and "normals" not in path and "matrix" not in path
    ]
    picked = random.sample(places, min(random.randint(0, 3), len(places)))
    return [f"{'.'.join(map(str, path))}={json.dumps(smaller(value, random))}" for path, value in picked]


def smaller(value: Any, random: Random) -> Any:
    share = random.uniform(0.75, 1)
    return (np.array(value) * share).tolist()


def put(scene: dict[str, Any], path: str, value: Any) -> None:
    """Edit a scene as an override does."""
    *way, last = path.split(".")
    part: Any = scene
    for step in way:
        part = part[int(step)] if isinstance(part, list) else part[step]
    if isinstance(part, list):
        part[int(last)] = value
    else:
        part[last] = value


@relation("exact")
def an_override_is_an_edit(case: Case, random: Random, studio: Studio) -> None:
    """`-D PATH=VALUE` is the file with that value; objects and lights by number or by name."""
    edited = case.copy()
    overrides = change(case, random)
    for text in overrides:
        path, _, value = text.partition("=")
        put(edited.scene, path, json.loads(value))
    if random.random() < 0.5:
        by_name = []
        for text in overrides:
            first, number, *rest = text.partition("=")[0].split(".")
            if first in ("objects", "lights"):
                path = ".".join([first, case.scene[first][int(number)]["name"], *rest])
                text = f"{path}={text.partition('=')[2]}"
            by_name.append(text)
        overrides = by_name
    layers = (*ALL, *light_layers(case))
    path = case.write(studio.folder())
    same(pictures(path, overrides, layers), studio(edited, layers))


CHOICES = ("model", "shape", "falloff", "law", "D", "F", "file", "texture", "vertex")
"""Keys that say what a mapping is: over another one it replaces it."""


def dealt(part: dict[str, Any], random: Random) -> tuple[dict[str, Any], dict[str, Any]]:
    """A mapping as two that make it, the second on top of the first."""
    base: dict[str, Any] = {}
    top: dict[str, Any] = {}
    for key, value in part.items():
        where = random.random()
        if isinstance(value, dict) and value and where < 0.5:
            base[key], top[key] = dealt(value, random)
        elif key in CHOICES or where < 0.65:
            base[key] = value
        elif where < 0.85:
            top[key] = value
        else:
            base[key] = smaller(value, random) if isinstance(value, float) else value
            top[key] = value
    if random.random() < 0.2 and "emission" not in part and "model" in part:
        base["emission"], top["emission"] = 0.7, None  # null takes away
    return base, top


@relation("exact")
def extends_is_a_merge(case: Case, random: Random, studio: Studio) -> None:
    """A scene that extends another, from another folder, is both merged."""
    base, top = dealt({key: value for key, value in case.scene.items() if key != "version"}, random)
    folder = studio.folder()
    case.write(folder)
    under = random.choice(["", "below/"])
    files = [*case.meshes, *case.images, MEASUREMENT]

    def away(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: away(each) for key, each in value.items()}
        if isinstance(value, list):
            return [away(each) for each in value]
        return f"../{value}" if under and value in files else value

    (folder / under).mkdir(exist_ok=True)
    Case({"version": 1, **away(base)}).write(folder / under, "base")
    path = Case({"version": 1, "extends": f"{under}base.yaml", **top}).write(folder, "top")
    layers = (*ALL, *light_layers(case))
    same(studio(case, layers), pictures(path, layers=layers))


@relation("exact")
def a_sweep_is_as_many_renders(case: Case, random: Random, studio: Studio) -> None:
    """The variants of a sweep are the files that `render` writes for each, whatever they keep for each
    other, with and without a store."""
    case = one_camera(case)
    case.scene["outputs"] = {"colour": "float"}
    folder = studio.folder()
    path = case.write(folder)
    rows = [dict(text.split("=", 1) for text in change(case, random)) for _ in range(3)]
    variants = [Variant(values, frame) for frame, values in enumerate(rows)]
    layers = (*ALL, "lights", "shadows")
    keep = random.random() < 0.5
    pattern = str(folder / "swept{frame}.exr")
    made = sweep_scene(path, variants, RenderOptions(pattern=pattern, only=layers, threads=1, cache=keep))
    for variant, outcome in zip(variants, made.outcomes, strict=True):
        alone = folder / f"alone{variant.frame}.exr"
        render.render_scene(
            RenderJob(path, RenderOptions(variant.overrides, str(alone), layers, threads=1, cache=False))
        )
        same(file_pictures(outcome.paths[0]), file_pictures(alone))


@relation("exact")
def a_frame_is_an_override(case: Case, random: Random, studio: Studio) -> None:
    """A scene at a frame of its curves is the scene with the values that the curves have there."""
    case = one_camera(case)
    case.scene["outputs"] = {"colour": "float"}
    folder = studio.folder()
    path = case.write(folder)
    values = dict(text.split("=", 1) for text in change(case, random))
    others = {name: json.dumps(smaller(json.loads(value), random)) for name, value in values.items()}
    curves = [
        f"{name}={{curve: step, keys: {{0: {others[name]}, 3: {value}, 7: {others[name]}}}}}"
        for name, value in values.items()
    ]
    made = []
    for number, (overrides, frame) in enumerate(
        ((curves, 5), ([f"{k}={v}" for k, v in values.items()], None))
    ):
        options = RenderOptions(overrides, str(folder / f"{number}.exr"), ALL, threads=1, cache=False)
        made.append(render.render_scene(RenderJob(path, options, frame))[0][0])
    same(*map(file_pictures, made))


@relation("exact")
def a_file_holds_what_is_made(case: Case, random: Random, studio: Studio) -> None:
    """The channels of an EXR file are the layers. Premises: one camera, single precision; no background,
    which the file adds to the beauty."""
    case = one_camera(case)
    case.scene["outputs"] = {"colour": "float"}
    case.scene["film"].pop("background", None)
    folder = studio.folder()
    path = case.write(folder)
    layers = (*ALL, "triangle_id", *light_layers(case))
    render.render_scene(
        RenderJob(path, RenderOptions((), str(folder / "file.exr"), layers, threads=1, cache=False))
    )
    channels = [values.astype(np.float32) for values in read_image(folder / "file.exr").channels.values()]
    made = [np.moveaxis(values, -1, 0) for values in pictures(path, layers=layers).values()]
    told = sorted(values.tobytes() for values in channels)
    known = sorted(plane.astype(np.float32).tobytes() for values in made for plane in values)
    assert told == known, f"{len(set(known) - set(told))} of {len(known)} planes are not in the file"


def file_pictures(path: Path) -> Pictures:
    """The channels of an image file, as pictures of one channel each."""
    channels = read_image(path).channels
    return {
        ("main", name): np.ascontiguousarray(values[..., None], np.float32)
        for name, values in channels.items()
    }
