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
from dataclasses import replace
from pathlib import Path

import numpy as np

from illumcli.accuracy.sampled import Sampling, Subject, subject
from illumcli.errors import InputError, LimitError
from illumcli.rays.sampling import stream
from illumcli.records import Record, Value
from illumcli.render_graph.build import views
from illumcli.render_graph.schedule import plan
from illumcli.scene.load import load

PIXELS, SHARE = 4000, 50
"""Pixels that a pilot renders twice: one in 50, but at least so many, since few of them hold edges."""
SEEDS = 8
"""Pairs of seeds that share a pilot's pixels."""
MOST = 4096
"""Samples per pixel beyond which no error is aimed for."""
RAYS = (4, 16)
"""Rays per sample that pilots try; from half of the least to twice the most are chosen."""
ATTEMPTS = 8
MARGIN = 0.9
"""Of the target, what pilots must stay below: they know the error to a tenth."""
SAMPLE_COST = 8
"""A sample costs as much as so many obscurance rays, itself included."""
STEEPEST, FLATTEST = 2.0, 1.0
"""What a fitted variance may fall by: with the square of the count, or as that of independent samples."""


class Law(Value):
    """variance = at_one * count ** -power"""

    at_one: float
    power: float

    @classmethod
    def through(cls, few: tuple[int, float], many: tuple[int, float], flattest: float = FLATTEST) -> Law:
        """The law through the variances at two counts; 0 where neither has any."""
        (n, v), (m, w) = few, many
        if v <= 0 or w <= 0:
            return cls(max(v * n**flattest, w * m**flattest), flattest)
        power = min(max(math.log(v / w) / math.log(m / n), flattest), STEEPEST)
        return cls(w * m**power, power)

    def at(self, count: float) -> float:
        """The variance at a count."""
        return float(self.at_one * count**-self.power)


class Choice(Record):
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
        if scene.film.adaptive is not None:  # every pixel counts for the error that was asked for
            said.append("film.adaptive=null")
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
        loaded = replace(loaded, scene=loaded.scene.replaced(seed=seed))
    steps = plan(loaded.scene, loaded, only)
    means = [layer for layer in steps.layers if not layer.data]
    if not means:
        raise InputError(
            f"{path}: no layer asked for is a mean of samples; --target-error has nothing to reach"
        )
    layer = min(means, key=lambda layer: layer.buffer != "beauty")
    first = subject(loaded, layer.name, threads)
    subjects = tuple(map(first.seen_by, views(loaded.scene)))
    has_rays = "obscurance" in {step.output for step in steps.tile} and loaded.scene.obscurance is not None
    pilots = [Pilot(each, has_rays) for each in subjects]
    goal = (MARGIN * target) ** 2
    aim, rays = goal, 0
    for attempt in range(ATTEMPTS):
        counts = [pilot.counts(aim, target) for pilot in pilots]
        sampling = replace(
            pilots[0].sampling,
            pixel=max(pixel for pixel, _ in counts),
            obscurance=max(each for _, each in counts),
        )
        checks = [pair(each, sampling, f"check {attempt}") for each in subjects]
        rays += sum(count for _, count in checks)
        variance = max(found for found, _ in checks)
        if variance <= goal:
            break
        aim *= MARGIN * goal / variance
    total = rays + sum(pilot.rays for pilot in pilots)
    return Choice(target, sampling, math.sqrt(variance), subjects, total)


class Pilot:
    """What some pixels of a view, rendered twice at a few counts, tell of its variance."""

    def __init__(self, own: Subject, has_rays: bool) -> None:
        scene = own.scene
        sampler = scene.obscurance.sampler if scene.obscurance is not None else "spiral"
        self.sampling = Sampling(1, 0, sampler, scene.seed)
        self.rays = 0
        self.laws = {each: self._law(own, each) for each in (RAYS if has_rays else (0,))}

    def _law(self, own: Subject, each: int) -> Law:
        """How the variance falls with samples per pixel, of so many rays each. One sample per pixel is never
        looked at: what it errs at edges no pair can see."""
        found = []
        for pixel in (2, 8):
            sampling = replace(self.sampling, pixel=pixel, obscurance=each)
            variance, rays = pair(own, sampling, f"pilot {pixel} {each}")
            self.rays += rays
            found.append((pixel, variance))
        few, many = found
        return Law.through(few, many)

    def variance(self, pixel: int, each: int) -> float:
        """The variance at counts, by a power of the rays between the laws, and a little beyond."""
        if len(self.laws) == 1:
            return self.laws[0].at(pixel)
        few, many = ((rays, law.at(pixel)) for rays, law in self.laws.items())
        return Law.through(few, many, flattest=0.0).at(each)

    def counts(self, aim: float, target: float) -> tuple[int, int]:
        """Samples per pixel, a power of two, and rays per sample of least cost for a variance of `aim`.

        Raises
        ------
        LimitError
        """
        rays = range(RAYS[0] // 2, 2 * RAYS[-1] + 1) if len(self.laws) > 1 else (0,)
        enough = [
            (pixel * (SAMPLE_COST + each), pixel, each)
            for pixel in (1 << k for k in range(1, MOST.bit_length()))
            for each in rays
            if self.variance(pixel, each) <= aim
        ]
        if not enough:
            raise LimitError(
                f"an error of {target:g} takes more than {MOST} samples per pixel; aim for a larger one"
            )
        _, pixel, each = min(enough)
        return pixel, each


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
