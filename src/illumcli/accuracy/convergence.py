"""Convergence: error and time of a layer at 1, 2, 4, ... samples, against a reference with other seeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeAlias

from illumcli import __version__
from illumcli.accuracy.curves import Curve, Run, curve_through, point_of, rmse_of
from illumcli.accuracy.reference import Reference, Vary, reference_image, run_content
from illumcli.accuracy.sampled import SampledLayer, Sampling, sampled_layer
from illumcli.cache.location import open_store
from illumcli.errors import InputError
from illumcli.progress import Progress, no_progress
from illumcli.rays.sampling import stream
from illumcli.records import Value
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.scene.load import load
from illumcli.scene.spec import Scene
from illumcli.versions import versions
from illumcli.visibility.samplers import SAMPLERS

IMAGES = 5
"""Images that are held at once, in double precision."""
RANGES: dict[Vary, tuple[int, int]] = {"obscurance": (4, 256), "pixels": (2, 64), "both": (8, 512)}
"""Default least and greatest count per pixel: obscurance rays, samples, obscurance rays of all samples."""

RunKey: TypeAlias = tuple[str, int, int]
"""Sampler, count and repeat."""


class ConvergenceSettings(Value):
    """What is varied and measured."""

    overrides: tuple[str, ...] = ()
    vary: Vary | None = None
    """`obscurance`: rays per sample, with one sample through each pixel's centre. `pixels`: samples per
    pixel, each with the scene's obscurance rays. `both`: the two in turn. By default obscurance if there is
    any in the scene."""
    first: int | None = None
    last: int | None = None
    """Least and greatest count per pixel; by default those of `RANGES`."""
    layer: str | None = None
    """By default `obscurance` if only that is varied, otherwise `beauty`."""
    samplers: tuple[str, ...] = tuple(SAMPLERS)
    reconstruct: bool = True
    """Also the scene's sampler with reconstruction, unless the scene rules it out."""
    repeats: int = 3
    width: int | None = 320
    """The film is scaled down to at most this width, on which the error per pixel hardly depends."""
    camera: str | None = None
    """By default the first."""
    seed: int | None = None
    """By default the scene's."""
    threads: int | None = None
    cache: bool = True
    """Cache the reference for later runs."""


class Convergence(Value):
    """A layer's error at every sampling; the fields in the order of the JSON output."""

    scene: str
    layer: str
    camera: str
    width: int
    height: int
    vary: Vary
    repeats: int
    seed: int
    threads: int
    reference: Reference
    curves: tuple[Curve, ...]

    def as_data(self) -> dict[str, Any]:
        """The result for JSON output; numbers that are not finite are null."""
        return _finite({"illum": __version__, **asdict(self), "versions": versions()})


def measure_convergence(
    path: Path,
    settings: ConvergenceSettings | None = None,
    progress: Progress = no_progress,
    planned: Callable[[list[str]], None] = lambda contents: None,
) -> Convergence:
    """The error of a scene's layer at doubling sample counts, with every sampler.

    Parameters
    ----------
    planned
        Called with the content hash of every image before any is rendered, in the order of the result's runs.
    """
    settings = settings or ConvergenceSettings()
    loaded = load(path, settings.overrides)
    if settings.seed is not None:
        loaded = replace(loaded, scene=loaded.scene.model_copy(update={"seed": settings.seed}))
    scene = loaded.scene

    # What is varied, for which layer, and from where to where.
    vary = settings.vary or ("obscurance" if scene.obscurance is not None else "pixels")
    name = settings.layer or ("obscurance" if vary == "obscurance" else "beauty")
    layer = sampled_layer(loaded, name, settings.threads, settings.camera, settings.width)
    few, many = RANGES[vary]
    first = settings.first or few
    last = settings.last or max(many, 2 * first)
    levels = samplings(scene, vary, first, last, settings.samplers)
    if settings.reconstruct and _can_reconstruct(layer):
        own = [level for level in levels if scene.obscurance and level.sampler == scene.obscurance.sampler]
        levels += [replace(level, reconstruct=True) for level in own]
        levels.sort(key=lambda level: _count(level, vary))
    names = list(dict.fromkeys(level.name for level in levels))
    _refuse_unvaried(layer, vary)
    held = IMAGES * len(layer.layer.channels)
    refuse_memory(layer.view.height, layer.view.width, held, expected_memory(loaded, scene), str(path))

    # The content hash of every image.
    finest = max(levels, key=lambda level: level.rays)
    seeds = [stream(scene.seed, f"converge:{repeat}") for repeat in range(settings.repeats)]
    contents: dict[RunKey, str] = {
        (level.name, _count(level, vary), repeat): run_content(layer, replace(level, seed=seed), finest, vary)
        for repeat, seed in enumerate(seeds)
        for level in levels
    }
    in_order = sorted(contents, key=lambda key: (names.index(key[0]), *key[1:]))
    planned([contents[key] for key in in_order])

    # Render the images and compute their errors.
    truth, reference = reference_image(layer, finest, vary, open_store() if settings.cache else None)
    runs: dict[RunKey, Run] = {}
    total, done = settings.repeats * sum(map(_cost, levels)), 0
    for repeat, seed in enumerate(seeds):
        for level in levels:  # samplers in turn, so that other load on the machine affects all alike
            key = level.name, _count(level, vary), repeat
            values, rays, seconds = layer.render(replace(level, seed=seed))
            error = rmse_of(values, truth, reference.rmse)
            runs[key] = Run(repeat, seed, rays, seconds, error, contents[key])
            done += _cost(level)
            progress(loaded.name, done, total)
    return Convergence(
        str(path), layer.layer.name, layer.view.name, layer.view.width, layer.view.height,
        vary, settings.repeats, scene.seed, layer.threads, reference,
        _curves(settings.repeats, levels, vary, runs),
    )  # fmt: skip


def _curves(
    repeats: int, levels: Sequence[Sampling], vary: Vary, runs: Mapping[RunKey, Run]
) -> tuple[Curve, ...]:
    """A curve for each sampler, and for reconstruction."""
    curves = []
    for name in dict.fromkeys(level.name for level in levels):
        points = []
        for level in levels:
            count = _count(level, vary)
            if level.name == name:
                points.append(
                    point_of(level, count, [runs[name, count, repeat] for repeat in range(repeats)])
                )
        curves.append(curve_through(name, points))
    return tuple(curves)


def _can_reconstruct(layer: SampledLayer) -> bool:
    """Does the layer depend on obscurance that can be reconstructed?"""
    settings = layer.scene.obscurance
    if settings is None or settings.reconstruct is False:
        return False
    return bool(layer.planned(Sampling(1, 1, settings.sampler, 0, reconstruct=True)).before)


def samplings(scene: Scene, vary: Vary, first: int, last: int, samplers: Sequence[str]) -> list[Sampling]:
    """Every sampling to measure, counts ascending, samplers in turn, with seed 0.

    Raises
    ------
    InputError
        The scene has nothing to vary, or there is no second count in the range.
    """
    least = {"obscurance": 1, "pixels": 2, "both": 4}[vary]
    if first < least:
        raise InputError(f"--from {first}: with --vary {vary} the least count with a random error is {least}")
    if last < 2 * first:
        raise InputError(f"from {first} to {last} there is one count only; let --to be at least twice --from")
    if vary != "pixels" and scene.obscurance is None:
        raise InputError(
            "the scene has no obscurance to vary; use --vary pixels, or -D obscurance.samples=64"
        )

    # Samples per pixel and rays per sample at each count.
    rays = scene.obscurance.samples if scene.obscurance is not None else 0
    levels = []
    for count in [first << k for k in range((last // first).bit_length())]:
        root = 1 << count.bit_length() // 2
        pixel, each = {"obscurance": (1, count), "pixels": (count, rays), "both": (root, count // root)}[vary]
        levels += [Sampling(pixel, each, sampler, 0) for sampler in samplers]
    return levels


def _count(sampling: Sampling, vary: Vary) -> int:
    """The count per pixel that is varied."""
    return sampling.pixel if vary == "pixels" else sampling.rays


def _cost(sampling: Sampling) -> int:
    """Rays per pixel, camera rays included."""
    return sampling.pixel * (1 + sampling.obscurance)


def _refuse_unvaried(layer: SampledLayer, vary: Vary) -> None:
    """Raise InputError if a layer does not depend on what is varied."""
    plan = layer.planned(Sampling(1, 1, "spiral", 0))
    if vary == "obscurance" and "obscurance" not in plan.buffers:
        raise InputError(
            f"layer '{layer.layer.name}' casts no obscurance ray; use --vary pixels or another --layer"
        )


def _finite(value: Any) -> Any:
    """`value` with None for every number that is not finite."""
    if isinstance(value, dict):
        return {name: _finite(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
