"""Run time against error: a layer at doubling samples, beside a reference that other random numbers made.

References
----------
Efron, B. and Tibshirani, R. (1993). An Introduction to the Bootstrap: two halves of a sample tell its error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from statistics import median
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.accuracy.sampled import Sampler, Sampling, Subject, subject
from illumcli.cache.fingerprint import digest
from illumcli.cache.store import Store
from illumcli.commands.render import opened_store, versions
from illumcli.errors import InputError
from illumcli.rays.sampling import stream
from illumcli.records import Value
from illumcli.render_graph.keys import Keys, code
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.scene.load import load
from illumcli.scene.spec import Scene

Vary: TypeAlias = Literal["obscurance", "pixels", "both"]
Progress = Callable[[str, int, int], None]

SAMPLERS: tuple[Sampler, ...] = ("spiral", "owen", "random")
PICTURES = 5
"""Whole pictures that are held at once, in double precision."""
DOUBLED: dict[Vary, tuple[int, int]] = {"obscurance": (4, 256), "pixels": (2, 64), "both": (8, 512)}
"""From where to where samples are doubled by default: rays, samples, or rays of all samples of a pixel."""
FINER: dict[Vary, tuple[int, int]] = {"obscurance": (1, 4), "pixels": (4, 1), "both": (2, 2)}
"""How many times the samples and the rays each of the finest run a half of the reference has."""


class Reference(Value):
    """What errors are measured against: the mean of two independent halves."""

    sampling: Sampling  # of each half, but for the seed
    rmse: float
    """Root of the mean square of half the halves' difference: the mean errs as much."""
    reused: bool


class Run(Value):
    """One picture."""

    repeat: int
    seed: int
    rays: int
    seconds: float
    rmse: float
    """Against the reference, its own error taken off."""
    content: str
    """Hash of all that the error depends on."""


class Point(Value):
    """All repeats at one sampling."""

    pixel: int
    obscurance: int
    count: int  # what is doubled, per pixel
    rays: int
    seconds: float  # median
    rmse: float  # over all repeats
    spread: float  # standard error of `rmse`, nan for a single repeat
    runs: tuple[Run, ...]


class Curve(Value):
    """A sampler's points and the line log rmse = constant + slope * log count through its runs."""

    sampler: Sampler
    points: tuple[Point, ...]
    slope: float
    slope_error: float  # standard error
    constant: float

    def count_for(self, rmse: float) -> float:
        """How many samples have this error, by the fitted line; nan where there is none."""
        if not (rmse > 0 and self.slope < 0):
            return math.nan
        return math.exp((math.log(rmse) - self.constant) / self.slope)


class Convergence(Value):
    """What `run` found."""

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
        """The result as JSON has it; what is not a number is null."""
        return _finite({"illum": __version__, **asdict(self), "versions": versions()})


def run(
    path: Path,
    overrides: Sequence[str] = (),
    vary: Vary | None = None,
    first: int | None = None,
    last: int | None = None,
    layer: str | None = None,
    samplers: Sequence[Sampler] = SAMPLERS,
    repeats: int = 3,
    seed: int | None = None,
    threads: int | None = None,
    camera: str | None = None,
    width: int | None = 320,
    progress: Progress = lambda what, done, of: None,
    cache: bool = True,
    planned: Callable[[list[str]], None] = lambda contents: None,
) -> Convergence:
    """A scene's layer rendered at doubling samples, by every sampler in turn, and its error.

    Parameters
    ----------
    vary
        `obscurance`: rays per sample, with one sample through each pixel's centre. `pixels`: samples per
        pixel, each with the scene's obscurance rays. `both`: the two in turn. By default obscurance where the
        scene has any.
    first, last
        The fewest and most per pixel of what is doubled; by default as `DOUBLED` has them.
    layer
        By default `obscurance` where only that is varied, else `beauty`.
    width
        The film is scaled down to at most this: error per pixel hardly depends on it.
    planned
        Gets the content of every picture before any is rendered, in the order of the result's runs.
    """
    loaded = load(path, overrides)
    if seed is not None:
        loaded = replace(loaded, scene=loaded.scene.replaced(seed=seed))
    scene = loaded.scene
    vary = vary or ("obscurance" if scene.obscurance is not None else "pixels")
    own = subject(
        loaded, layer or ("obscurance" if vary == "obscurance" else "beauty"), threads, camera, width
    )
    few, many = DOUBLED[vary]
    levels = samplings(scene, vary, first or few, last or max(many, 2 * (first or few)), samplers)
    _check(own, vary)
    held = PICTURES * len(own.layer.channels)
    refuse_memory(own.view.height, own.view.width, held, expected_memory(loaded, scene), str(path))
    finest = max(levels, key=lambda level: level.rays)
    contents = {
        (level.sampler, _count(level, vary), repeat): _content(
            own, replace(level, seed=own_seed), finest, vary
        )
        for repeat, own_seed in enumerate(_seeds(scene, repeats))
        for level in levels
    }
    planned([contents[key] for key in sorted(contents, key=lambda key: (samplers.index(key[0]), *key[1:]))])
    expected = sum(level.pixel * (1 + level.obscurance) for level in levels) * repeats
    made = 0

    def advance(sampling: Sampling) -> None:
        nonlocal made
        made += sampling.pixel * (1 + sampling.obscurance)
        progress(own.loaded.name, made, expected)

    truth, reference = referred(own, finest, vary, opened_store() if cache else None)
    runs: dict[tuple[Sampler, int], list[Run]] = {}
    for repeat, own_seed in enumerate(_seeds(scene, repeats)):
        for level in levels:  # in turn, so that whatever else the machine does meets all alike
            sampling = replace(level, seed=own_seed)
            values, rays, seconds = own.picture(sampling)
            error = rmse_of(values, truth, reference.rmse)
            key = level.sampler, _count(level, vary)
            content = contents[(*key, repeat)]
            runs.setdefault(key, []).append(Run(repeat, own_seed, rays, seconds, error, content))
            advance(sampling)
    curves = tuple(
        curve(
            sampler,
            [
                point(level, _count(level, vary), runs[sampler, _count(level, vary)])
                for level in levels
                if level.sampler == sampler
            ],
        )
        for sampler in samplers
    )
    return Convergence(
        str(path), own.layer.name, own.view.name, own.view.width, own.view.height,
        vary, repeats, scene.seed, own.threads, reference, curves,
    )  # fmt: skip


def samplings(scene: Scene, vary: Vary, first: int, last: int, samplers: Sequence[Sampler]) -> list[Sampling]:
    """Every sampling to measure, from few to many, samplers in turn; seeds are put in later.

    Raises
    ------
    InputError
        There is nothing to double, or too little room to do so.
    """
    least = {"obscurance": 1, "pixels": 2, "both": 4}[vary]
    if first < least:
        raise InputError(f"--from {first}: with --vary {vary} the first error that is random is at {least}")
    if last < 2 * first:
        raise InputError(f"from {first} to {last} nothing can be doubled; let --to be at least twice --from")
    if vary != "pixels" and scene.obscurance is None:
        raise InputError(
            "the scene has no obscurance to vary; use --vary pixels, or -D obscurance.samples=64"
        )
    rays = scene.obscurance.samples if scene.obscurance is not None else 0
    found = []
    for count in [first << k for k in range((last // first).bit_length())]:
        root = 1 << count.bit_length() // 2
        pixel, each = {"obscurance": (1, count), "pixels": (count, rays), "both": (root, count // root)}[vary]
        found += [Sampling(pixel, each, sampler, 0) for sampler in samplers]
    return found


def _seeds(scene: Scene, repeats: int) -> list[int]:
    return [stream(scene.seed, f"converge:{repeat}") for repeat in range(repeats)]


def _content(own: Subject, sampling: Sampling, finest: Sampling, vary: Vary) -> str:
    """Hash of all that a picture and its reference depend on."""
    halves = [_key(own, half) for half in _halves(own, finest, vary)]
    return digest((own.layer.name, _key(own, sampling), halves))


def _halves(own: Subject, finest: Sampling, vary: Vary) -> list[Sampling]:
    """How the two halves of the reference are sampled; by Owen's sampler: a bias of the spiral would show."""
    pixel, each = FINER[vary]
    half = Sampling(finest.pixel * pixel, finest.obscurance * each, "owen", 0)
    return [replace(half, seed=stream(own.scene.seed, f"reference:{name}")) for name in "ab"]


def _count(sampling: Sampling, vary: Vary) -> int:
    return sampling.pixel if vary == "pixels" else sampling.rays


def _check(own: Subject, vary: Vary) -> None:
    """Refuse a layer that what is varied does not change."""
    steps, _ = own.planned(Sampling(1, 1, "spiral", 0))
    if vary == "obscurance" and "obscurance" not in {step.output for step in steps.tile}:
        raise InputError(
            f"layer '{own.layer.name}' casts no obscurance ray; use --vary pixels or another --layer"
        )


def referred(
    own: Subject, finest: Sampling, vary: Vary, store: Store | None
) -> tuple[NDArray[np.float64], Reference]:
    """The reference and its error, kept in the store."""
    halves = _halves(own, finest, vary)
    key = digest([(own.layer.name, *_key(own, half)) for half in halves])
    stored = store.read(key) if store is not None else None
    shape = (own.view.height, own.view.width, len(own.layer.channels))
    arrays = () if stored is None else stored.arrays
    reused = [(each.shape, each.dtype.str) for each in arrays] == [(shape, "<f4")] * 2
    if reused:
        a, b = arrays
    else:
        a, b = (own.picture(half)[0] for half in halves)
        if store is not None:
            store.save(key, {"buffer": "reference", "layer": own.layer.name}, [a, b])
            store.finish()
    error = math.sqrt(np.square((a.astype(np.float64) - b) / 2).mean())
    return (a.astype(np.float64) + b) / 2, Reference(replace(halves[0], seed=0), error, reused)


def _key(own: Subject, sampling: Sampling) -> tuple[str, str]:
    steps, view = own.planned(sampling)
    return Keys(steps.book, view, code())(own.layer.buffer), repr(view)


def rmse_of(values: NDArray[np.float32], truth: NDArray[np.float64], reference: float) -> float:
    """Root of the mean squared difference, less what the reference itself errs; at least 0."""
    square = np.square(values - truth).mean() - reference**2
    return math.sqrt(max(float(square), 0.0))


def point(sampling: Sampling, count: int, runs: Sequence[Run]) -> Point:
    """What the repeats say together."""
    errors = np.array([run.rmse for run in runs])
    pooled = math.sqrt(np.square(errors).mean())
    spread = float(errors.std(ddof=1) / math.sqrt(len(errors))) if len(errors) > 1 else math.nan
    rays, seconds = round(median(run.rays for run in runs)), median(run.seconds for run in runs)
    return Point(
        sampling.pixel, sampling.obscurance, count, rays, seconds, pooled, spread, tuple(runs)
    )  # fmt: skip


def curve(sampler: Sampler, points: Sequence[Point]) -> Curve:
    """The points with the line through all runs that have an error, in logarithms."""
    pairs = [(math.log(p.count), math.log(run.rmse)) for p in points for run in p.runs if run.rmse > 0]
    slope, error, constant = line(pairs)
    return Curve(sampler, tuple(points), slope, error, constant)


def line(pairs: Sequence[tuple[float, float]]) -> tuple[float, float, float]:
    """Slope, its standard error and constant of least squares; nan where the pairs do not tell."""
    x, y = np.array(pairs, np.float64).reshape(-1, 2).T
    wide = float(np.square(x - x.mean()).sum()) if len(x) else 0.0
    if wide == 0:
        return math.nan, math.nan, math.nan
    slope = float(((x - x.mean()) * (y - y.mean())).sum()) / wide
    constant = float(y.mean() - slope * x.mean())
    rest = float(np.square(y - constant - slope * x).sum())
    error = math.sqrt(rest / (len(x) - 2) / wide) if len(x) > 2 else math.nan
    return slope, error, constant


def _finite(value: Any) -> Any:
    """The same with None for every number that is not finite."""
    if isinstance(value, dict):
        return {name: _finite(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
