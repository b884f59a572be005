"""How finely to sample for a picture of a given error, and how far off the picture is.

Nothing is decided on samples that are kept, which would bias them towards the decision: pilots on other
random numbers render some pixels twice, and half the mean squared difference of the pairs is an unbiased
sight of the picture's mean squared error. The picture itself then has fixed counts, as if the scene had said
them.

References
----------
Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.jobs.sampled import Sampling, Subject, subject
from illumcli.plan.plan import plan
from illumcli.plan.recipes import views
from illumcli.rays.sampling import stream
from illumcli.scene.load import load

PIXELS, SHARE = 4000, 50
"""Pixels that a pilot renders twice: one in 50, but at least so many, since few of them hold edges."""
SEEDS = 8
"""Pairs of seeds that share a pilot's pixels."""
MOST = 4096
"""Samples per pixel, and rays per sample, beyond which no error is aimed for."""
SAMPLE_COST = 8
"""A sample costs as much as so many obscurance rays, itself included."""
STEEPEST, FLATTEST = 2.0, 1.0
"""What a fitted variance may fall by: with the square of the count, or as that of independent samples."""


@dataclass(frozen=True, slots=True)
class Law:
    """variance = at_one * count ** -power"""

    at_one: float
    power: float

    @classmethod
    def through(cls, few: tuple[int, float], many: tuple[int, float]) -> Law:
        """The law through the variances at two counts; 0 where neither has any."""
        (n, v), (m, w) = few, many
        if v <= 0 or w <= 0:
            return cls(max(v * n, w * m, 0.0), FLATTEST)
        power = min(max(math.log(v / w) / math.log(m / n), FLATTEST), STEEPEST)
        return cls(w * m**power, power)

    def at(self, count: float) -> float:
        """The variance at a count."""
        return float(self.at_one * count**-self.power)

    def count_for(self, variance: float) -> int:
        """The least count of at most this variance."""
        if self.at_one <= 0:
            return 1
        return max(1, math.ceil((self.at_one / variance) ** (1 / self.power))) if variance > 0 else MOST + 1


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """Counts for a target, and what chose them."""

    target: float
    sampling: Sampling
    expected: float
    """Largest RMSE of the pilots at these counts, over the cameras."""
    subjects: tuple[Subject, ...]
    pilot_rays: int

    @property
    def overrides(self) -> tuple[str, ...]:
        """The counts as `-D` has them."""
        said = [f"film.samples={self.sampling.pixel}"]
        scene = self.subjects[0].scene
        for name, camera in scene.named_cameras().items():
            if camera.samples is not None:
                place = f"cameras.{name}" if scene.cameras else "camera"
                said.append(f"{place}.samples={self.sampling.pixel}")
        if self.sampling.obscurance:
            said.append(f"obscurance.samples={self.sampling.obscurance}")
        return tuple(said)

    def reached(self) -> float:
        """RMSE of the picture: its own pixels, one in 50, beside others of the same counts; largest of all
        cameras."""
        own = replace(self.sampling, seed=self.subjects[0].scene.seed)
        pairs = [pair(each, own, "reached", own.seed) for each in self.subjects]
        return math.sqrt(max(variance for variance, _ in pairs))

    def as_data(self) -> dict[str, float]:
        """What a report says of it."""
        return {
            "target": self.target,
            "reached": self.reached(),
            "expected": self.expected,
            "pixel_samples": self.sampling.pixel,
            "obscurance_samples": self.sampling.obscurance,
            "pilot_rays": self.pilot_rays,
        }


def chosen(
    path: Path,
    target: float,
    overrides: Sequence[str] = (),
    only: Sequence[str] = (),
    seed: int | None = None,
    threads: int | None = None,
) -> Choice:
    """Samples per pixel and obscurance rays per sample that reach the RMSE `target` at the least cost.

    The error is that of the first layer asked for that is a mean of samples, `beauty` where it is among them.

    Raises
    ------
    InputError
        No layer has an error.
    LimitError
        More samples than this program takes on.
    """
    loaded = load(path, overrides)
    if seed is not None:
        loaded = replace(loaded, scene=loaded.scene.model_copy(update={"seed": seed}))
    steps = plan(loaded.scene, loaded, only)
    means = [layer for layer in steps.layers if not layer.data]
    if not means:
        raise InputError(
            f"{path}: no layer asked for is a mean of samples; --target-error has nothing to reach"
        )
    layer = min(means, key=lambda layer: layer.buffer != "beauty")
    first = subject(loaded, layer.name, threads)
    subjects = tuple(replace(first, view=view) for view in views(loaded.scene))
    has_rays = "obscurance" in {step.makes for step in steps.tile} and loaded.scene.obscurance is not None
    pilots = [Pilot(each, has_rays) for each in subjects]
    aim, rays = target**2, 0
    for attempt in range(4):
        counts = [pilot.counts(aim, target) for pilot in pilots]
        sampling = replace(
            pilots[0].sampling,
            pixel=max(pixel for pixel, _ in counts),
            obscurance=max(each for _, each in counts),
        )
        checks = [pair(each, sampling, f"check {attempt}") for each in subjects]
        rays += sum(count for _, count in checks)
        variance = max(found for found, _ in checks)
        if variance <= target**2:
            break
        aim *= 0.95 * target**2 / variance
    total = rays + sum(pilot.rays for pilot in pilots)
    return Choice(target, sampling, math.sqrt(variance), subjects, total)


class Pilot:
    """What some pixels of a view, rendered twice at four counts, tell of its variance."""

    def __init__(self, own: Subject, has_rays: bool) -> None:
        scene = own.scene
        sampler = scene.obscurance.sampler if scene.obscurance is not None else "spiral"
        self.sampling = Sampling(1, 0, sampler, scene.seed)
        self.rays = 0
        # through the centre of its pixel a sample errs by its rays alone
        self.open = self._law(own, ((1, 8), (1, 32))) if has_rays else None
        each = 8 if has_rays else 0
        self.edges = self._law(own, ((4, each), (16, each)))

    def _law(self, own: Subject, counts: Sequence[tuple[int, int]]) -> Law:
        found = []
        for pixel, each in counts:
            sampling = replace(self.sampling, pixel=pixel, obscurance=each)
            variance, rays = pair(own, sampling, f"pilot {pixel} {each}")
            self.rays += rays
            if pixel > 1 and self.open is not None:
                variance -= self.open.at(each) / pixel
            found.append((pixel if pixel > 1 else each, variance))
        return Law.through(*found)

    def counts(self, aim: float, target: float) -> tuple[int, int]:
        """Samples per pixel, a power of two, and rays per sample of least cost for a variance of `aim`.

        The rays of a pixel's samples err independently, at worst. One sample per pixel is never enough: what
        it errs at edges no pair can see.

        Raises
        ------
        LimitError
        """
        best: tuple[float, int, int] | None = None
        for pixel in (1 << k for k in range(1, MOST.bit_length())):
            left = aim - self.edges.at(pixel)
            each = self.open.count_for(pixel * left) if self.open is not None else 0
            cost = pixel * (SAMPLE_COST + each)
            if left > 0 and each <= MOST and (best is None or cost < best[0]):
                best = cost, pixel, each
        if best is None:
            raise LimitError(
                f"an error of {target:g} takes more than {MOST} samples per pixel; aim for a larger one"
            )
        return best[1:]


def pair(own: Subject, sampling: Sampling, purpose: str, seed: int | None = None) -> tuple[float, int]:
    """Mean square error at a sampling by pairs of pictures of some pixels, and the rays it took.

    One of each pair has the random numbers of `seed` where it is given; all others are of `purpose` alone, in
    several groups: the pattern of rays over the film differs from seed to seed by one shift for all pixels,
    so that two seeds alone may by chance agree everywhere.
    """
    x, y = own.scattered(max(PIXELS, own.view.width * own.view.height // SHARE), purpose)
    mix = np.random.default_rng(0).permutation(len(x))
    square, rays = 0.0, 0
    for group, lane in enumerate(np.array_split(mix, SEEDS)):
        seeds = [stream(own.scene.seed, f"{purpose}:{group}:{half}") for half in "ab"]
        a, first = own.pixels(replace(sampling, seed=seeds[0] if seed is None else seed), x[lane], y[lane])
        b, second = own.pixels(replace(sampling, seed=seeds[1]), x[lane], y[lane])
        square += float(np.square(a - b).sum()) / a.shape[1]
        rays += first + second
    return square / len(x) / 2, rays
