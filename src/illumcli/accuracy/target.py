"""Chooses sample counts for a target error, and measures the error of the image.

Choosing counts by the image's own samples would bias it. Instead, pilots with other random numbers render
some pixels twice: half the mean squared difference of the pairs is an unbiased estimate of the image's mean
squared error. The image itself then has fixed counts, as if the scene had set them.

References
----------
Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from illumcli.accuracy.audit import AuditedError
from illumcli.accuracy.sampled import SampledLayer, Sampling, sampled_layer
from illumcli.errors import InputError, LimitError
from illumcli.rays.sampling import stream
from illumcli.records import Record, Value
from illumcli.render_graph.build import build
from illumcli.render_graph.limits import refuse_rays
from illumcli.render_graph.schedule import outputs_of, reached
from illumcli.scene.load import load
from illumcli.scene.spec import Scene

MIN_PIXELS, FILM_SHARE = 4000, 50
"""Pixels that a pilot renders twice: one in 50 of the film, but at least 4000, since few contain edges."""
SEEDS = 8
"""Pairs of seeds of a pilot, each for an equal part of its pixels."""
MAX_SAMPLES = 4096
"""Samples per pixel, at most."""
RAYS = (4, 16)
"""Obscurance rays per sample of the pilots; the choice is between half the first and twice the second."""
ATTEMPTS = 8
MARGIN = 0.9
"""Factor on the target: pilots measure the error to about a tenth."""
SAMPLE_COST = 8
"""Cost of a camera sample, counted in obscurance rays."""
STEEPEST, FLATTEST = 2.0, 1.0
"""Bounds of the exponent of a variance law: 1 is independent samples."""


class VarianceLaw(Value):
    """variance = at_one * count ** -power"""

    at_one: float
    power: float

    @classmethod
    def through(
        cls, few: tuple[int, float], many: tuple[int, float], flattest: float = FLATTEST
    ) -> VarianceLaw:
        """The law through the variances at two counts, given as (count, variance); 0 if both are 0."""
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
        """The counts as `-D` overrides."""
        scene = self.layers[0].scene
        counts = count_overrides(scene, self.sampling.pixel, self.sampling.obscurance)
        if scene.film.adaptive is not False:  # the choice is for images without adaptive sampling
            counts = (*counts, "film.adaptive=false")
        fitted = scene.obscurance is not None and scene.obscurance.reconstruct
        return (*counts, "obscurance.reconstruct=false") if fitted else counts

    @property
    def audited(self) -> Mapping[str, AuditedError]:
        """Nothing is reconstructed."""
        return {}

    def reached(self) -> float:
        """RMSE of the image, the largest over the cameras: one in 50 of its pixels is rendered again, with
        the same counts and other random numbers."""
        rendered = replace(self.sampling, seed=self.layers[0].scene.seed)
        pairs = [paired_error(each, rendered, "reached", rendered.seed) for each in self.layers]
        return math.sqrt(max(variance for variance, _ in pairs))

    def as_data(self) -> dict[str, float]:
        """The choice for reports."""
        return {
            "target": self.target,
            "reached": self.reached(),
            "expected": self.expected,
            "pixel_samples": self.sampling.pixel,
            "obscurance_samples": self.sampling.obscurance,
            "reconstructed": False,
            "pilot_rays": self.pilot_rays,
        }


def count_overrides(scene: Scene, pixel: int, obscurance: int) -> tuple[str, ...]:
    """`-D` overrides for samples per pixel and, unless 0, obscurance rays per sample, of all cameras."""
    overrides = [f"film.samples={pixel}"]
    for name, camera in scene.named_cameras().items():
        if camera.samples is not None:
            place = f"cameras.{name}" if scene.cameras else "camera"
            overrides.append(f"{place}.samples={pixel}")
    if obscurance:
        overrides.append(f"obscurance.samples={obscurance}")
    return tuple(overrides)


def choose_sampling(
    path: Path,
    target: float,
    overrides: Sequence[str] = (),
    only: Sequence[str] = (),
    seed: int | None = None,
    threads: int | None = None,
) -> SamplingChoice:
    """Samples per pixel and obscurance rays per sample that reach the RMSE `target` at the least cost.

    The error is that of `beauty` if it is requested, otherwise of the first layer that is a mean of samples.

    Raises
    ------
    InputError
        No layer has an error.
    LimitError
        The target needs more than `MAX_SAMPLES` samples per pixel.
    """
    # The layer, and whether it casts obscurance rays.
    loaded = load(path, overrides)
    if seed is not None:
        loaded = replace(loaded, scene=loaded.scene.model_copy(update={"seed": seed}))
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, only)
    refuse_rays(graph, outputs)
    means = [layer for layer in outputs if not layer.data]
    if not means:
        raise InputError(f"{path}: no requested layer is a mean of samples; --target-error needs one")
    layer = min(means, key=lambda layer: layer.buffer != "beauty")
    first = sampled_layer(loaded, layer.name, threads)
    layers = tuple(map(first.seen_by, graph.views))
    has_rays = "obscurance" in reached(graph, outputs) and loaded.scene.obscurance is not None

    # The counts of least cost by the pilots' laws, with a lower aim until pairs at these counts confirm it.
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
    """Variance laws of a layer, fitted to some pixels that are rendered twice at a few counts."""

    def __init__(self, layer: SampledLayer, has_rays: bool) -> None:
        scene = layer.scene
        sampler = scene.obscurance.sampler if scene.obscurance is not None else "spiral"
        self.sampling = Sampling(1, 0, sampler, scene.seed)
        self.rays = 0
        self.laws = {each: self._law(layer, each) for each in (RAYS if has_rays else (0,))}

    def _law(self, layer: SampledLayer, each: int) -> VarianceLaw:
        """Variance over samples per pixel, with `each` rays per sample. It is not measured at one sample per
        pixel, which is always at the pixel's centre: pairs do not show its error at edges."""
        variances = []
        for pixel in (2, 8):
            sampling = replace(self.sampling, pixel=pixel, obscurance=each)
            variance, rays = paired_error(layer, sampling, f"pilot {pixel} {each}")
            self.rays += rays
            variances.append((pixel, variance))
        few, many = variances
        return VarianceLaw.through(few, many)

    def variance(self, pixel: int, each: int) -> float:
        """The variance at counts: a power law in the rays per sample, through the laws at two of them."""
        if len(self.laws) == 1:
            return self.laws[0].at(pixel)
        few, many = ((rays, law.at(pixel)) for rays, law in self.laws.items())
        return VarianceLaw.through(few, many, flattest=0.0).at(each)

    def counts(self, aim: float, target: float) -> tuple[int, int]:
        """Samples per pixel, a power of two, and rays per sample for a variance of `aim`, at the least cost.

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
                f"an error of {target:g} needs more than {MAX_SAMPLES} samples per pixel; choose a larger one"
            )
        _, pixel, each = min(enough)
        return pixel, each


def paired_error(
    layer: SampledLayer, sampling: Sampling, purpose: str, seed: int | None = None
) -> tuple[float, int]:
    """Mean square error at a sampling, from pairs of renders of some pixels, and the rays that were cast.

    If `seed` is given, one render of each pair has its random numbers; those of all others depend on
    `purpose`. The pixels are divided into groups with different seeds: the patterns of two seeds differ by
    one shift for all pixels of the film, so a single pair of seeds may agree everywhere by chance.
    """
    # Random pixels, in groups.
    x, y = layer.random_pixels(max(MIN_PIXELS, layer.view.width * layer.view.height // FILM_SHARE), purpose)
    shuffled = np.random.default_rng(0).permutation(len(x))

    # Both renders of each group.
    square, rays = 0.0, 0
    for group, index in enumerate(np.array_split(shuffled, SEEDS)):
        seeds = [stream(layer.scene.seed, f"{purpose}:{group}:{half}") for half in "ab"]
        first_seed = seeds[0] if seed is None else seed
        a, first = layer.render_pixels(replace(sampling, seed=first_seed), x[index], y[index])
        b, second = layer.render_pixels(replace(sampling, seed=seeds[1]), x[index], y[index])
        square += float(np.square(a - b).sum()) / a.shape[1]
        rays += first + second
    return square / len(x) / 2, rays
