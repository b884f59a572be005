"""Choose sample counts for an image of a given error, and measure the error of that image.

Choosing counts by the samples of the image would bias it. Instead, pilots with other random numbers render
some pixels twice: half the mean squared difference of the pairs is an unbiased estimate of the image's mean
squared error. The image itself then has fixed counts, as if the scene had named them.

References
----------
Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from illumcli.accuracy.sampled import SampledLayer, Sampling, sampled_layer
from illumcli.errors import InputError, LimitError
from illumcli.rays.sampling import stream
from illumcli.records import Record, Value
from illumcli.render_graph.build import build
from illumcli.render_graph.limits import refuse_rays
from illumcli.render_graph.schedule import outputs_of, reached
from illumcli.scene.load import load

MIN_PIXELS, FILM_SHARE = 4000, 50
"""Pixels that a pilot renders twice: one in 50 of the film, but at least so many, since few hold edges."""
SEEDS = 8
"""Pairs of seeds that share a pilot's pixels."""
MAX_SAMPLES = 4096
"""Samples per pixel, at most."""
RAYS = (4, 16)
"""Rays per sample that pilots try; from half of the least to twice the most are chosen."""
ATTEMPTS = 8
MARGIN = 0.9
"""Share of the target that pilots must stay below: they measure the error to a tenth."""
SAMPLE_COST = 8
"""Cost of a camera sample, counted in obscurance rays."""
STEEPEST, FLATTEST = 2.0, 1.0
"""Powers of a fitted variance law: at most the square of the count, at least that of independent samples."""


class VarianceLaw(Value):
    """variance = at_one * count ** -power"""

    at_one: float
    power: float

    @classmethod
    def through(
        cls, few: tuple[int, float], many: tuple[int, float], flattest: float = FLATTEST
    ) -> VarianceLaw:
        """The law through the variances at two counts; 0 where neither has a variance."""
        (n, v), (m, w) = few, many
        if v <= 0 or w <= 0:
            return cls(max(v * n**flattest, w * m**flattest), flattest)
        power = min(max(math.log(v / w) / math.log(m / n), flattest), STEEPEST)
        return cls(w * m**power, power)

    def at(self, count: float) -> float:
        """The variance at a count."""
        return float(self.at_one * count**-self.power)


class SamplingChoice(Record):
    """Sample counts for a target error, and how they were chosen."""

    target: float
    sampling: Sampling
    expected: float
    """Largest RMSE of the pilots at these counts, over the cameras."""
    layers: tuple[SampledLayer, ...]
    pilot_rays: int

    @property
    def overrides(self) -> tuple[str, ...]:
        """The counts as `-D` gives them."""
        overrides = [f"film.samples={self.sampling.pixel}"]
        scene = self.layers[0].scene
        if scene.film.adaptive is not None:  # every pixel counts for the error that was asked for
            overrides.append("film.adaptive=null")
        for name, camera in scene.named_cameras().items():
            if camera.samples is not None:
                place = f"cameras.{name}" if scene.cameras else "camera"
                overrides.append(f"{place}.samples={self.sampling.pixel}")
        if self.sampling.obscurance:
            overrides.append(f"obscurance.samples={self.sampling.obscurance}")
        return tuple(overrides)

    def reached(self) -> float:
        """RMSE of the image, the largest of all cameras: one in 50 of its pixels, paired with other samples
        of the same counts."""
        rendered = replace(self.sampling, seed=self.layers[0].scene.seed)
        pairs = [paired_error(each, rendered, "reached", rendered.seed) for each in self.layers]
        return math.sqrt(max(variance for variance, _ in pairs))

    def as_data(self) -> dict[str, float]:
        """The choice as reports hold it."""
        return {
            "target": self.target,
            "reached": self.reached(),
            "expected": self.expected,
            "pixel_samples": self.sampling.pixel,
            "obscurance_samples": self.sampling.obscurance,
            "pilot_rays": self.pilot_rays,
        }


def choose_sampling(
    path: Path,
    target: float,
    overrides: Sequence[str] = (),
    only: Sequence[str] = (),
    seed: int | None = None,
    threads: int | None = None,
) -> SamplingChoice:
    """Samples per pixel and obscurance rays per sample that reach the RMSE `target` at the least cost.

    The error is that of the first layer asked for that is a mean of samples, `beauty` where it is among them.

    Raises
    ------
    InputError
        No layer has an error.
    LimitError
        The target takes more than `MAX_SAMPLES` samples per pixel.
    """
    # the layer, and whether it casts obscurance rays
    loaded = load(path, overrides)
    if seed is not None:
        loaded = replace(loaded, scene=loaded.scene.model_copy(update={"seed": seed}))
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, only)
    refuse_rays(graph, outputs)
    means = [layer for layer in outputs if not layer.data]
    if not means:
        raise InputError(
            f"{path}: no layer asked for is a mean of samples; --target-error has nothing to reach"
        )
    layer = min(means, key=lambda layer: layer.buffer != "beauty")
    first = sampled_layer(loaded, layer.name, threads)
    layers = tuple(map(first.seen_by, graph.views))
    has_rays = "obscurance" in reached(graph, outputs) and loaded.scene.obscurance is not None

    # counts of least cost by the pilots' laws, until pairs at these counts confirm them
    pilots = [Pilot(each, has_rays) for each in layers]
    goal = (MARGIN * target) ** 2
    aim, rays = goal, 0
    for attempt in range(ATTEMPTS):
        counts = [pilot.counts(aim, target) for pilot in pilots]
        sampling = replace(
            pilots[0].sampling,
            pixel=max(pixel for pixel, _ in counts),
            obscurance=max(each for _, each in counts),
        )
        checks = [paired_error(each, sampling, f"check {attempt}") for each in layers]
        rays += sum(count for _, count in checks)
        variance = max(each for each, _ in checks)
        if variance <= goal:
            break
        aim *= MARGIN * goal / variance
    total = rays + sum(pilot.rays for pilot in pilots)
    return SamplingChoice(target, sampling, math.sqrt(variance), layers, total)


class Pilot:
    """Laws of a layer's variance, from some pixels that are rendered twice at a few counts."""

    def __init__(self, layer: SampledLayer, has_rays: bool) -> None:
        scene = layer.scene
        sampler = scene.obscurance.sampler if scene.obscurance is not None else "spiral"
        self.sampling = Sampling(1, 0, sampler, scene.seed)
        self.rays = 0
        self.laws = {each: self._law(layer, each) for each in (RAYS if has_rays else (0,))}

    def _law(self, layer: SampledLayer, each: int) -> VarianceLaw:
        """Variance over samples per pixel, with so many rays each. One sample per pixel is not tried: pairs
        of pixel centres cannot see its error at edges."""
        variances = []
        for pixel in (2, 8):
            sampling = replace(self.sampling, pixel=pixel, obscurance=each)
            variance, rays = paired_error(layer, sampling, f"pilot {pixel} {each}")
            self.rays += rays
            variances.append((pixel, variance))
        few, many = variances
        return VarianceLaw.through(few, many)

    def variance(self, pixel: int, each: int) -> float:
        """The variance at counts: a power law in the rays, through the laws at two numbers of rays."""
        if len(self.laws) == 1:
            return self.laws[0].at(pixel)
        few, many = ((rays, law.at(pixel)) for rays, law in self.laws.items())
        return VarianceLaw.through(few, many, flattest=0.0).at(each)

    def counts(self, aim: float, target: float) -> tuple[int, int]:
        """Samples per pixel, a power of two, and rays per sample of least cost for a variance of `aim`.

        Raises
        ------
        LimitError
        """
        rays = range(RAYS[0] // 2, 2 * RAYS[-1] + 1) if len(self.laws) > 1 else (0,)
        enough = [
            (pixel * (SAMPLE_COST + each), pixel, each)
            for pixel in (1 << k for k in range(1, MAX_SAMPLES.bit_length()))
            for each in rays
            if self.variance(pixel, each) <= aim
        ]
        if not enough:
            raise LimitError(
                f"an error of {target:g} takes more than {MAX_SAMPLES} samples per pixel; aim for a larger "
                "one"
            )
        _, pixel, each = min(enough)
        return pixel, each


def paired_error(
    layer: SampledLayer, sampling: Sampling, purpose: str, seed: int | None = None
) -> tuple[float, int]:
    """Mean square error at a sampling, from pairs of renderings of some pixels, and the rays it took.

    One of each pair has the random numbers of `seed` where it is given; all others depend on `purpose`. The
    pixels are divided into groups of different seeds: the pattern of rays over the film differs from seed to
    seed by one shift for all pixels, so that two seeds alone may agree everywhere by chance.
    """
    # pixels at random, in groups
    x, y = layer.random_pixels(max(MIN_PIXELS, layer.view.width * layer.view.height // FILM_SHARE), purpose)
    mix = np.random.default_rng(0).permutation(len(x))

    # both renderings of each group
    square, rays = 0.0, 0
    for group, index in enumerate(np.array_split(mix, SEEDS)):
        seeds = [stream(layer.scene.seed, f"{purpose}:{group}:{half}") for half in "ab"]
        first_seed = seeds[0] if seed is None else seed
        a, first = layer.render_pixels(replace(sampling, seed=first_seed), x[index], y[index])
        b, second = layer.render_pixels(replace(sampling, seed=seeds[1]), x[index], y[index])
        square += float(np.square(a - b).sum()) / a.shape[1]
        rays += first + second
    return square / len(x) / 2, rays
