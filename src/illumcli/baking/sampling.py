"""Estimates of obscurance at the points of a bake, and their errors from pairs of fresh scrambles."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, cross, dot
from illumcli.baking.measures import Measure
from illumcli.baking.occluders import Occluders
from illumcli.baking.points import Points
from illumcli.baking.resume import load_unit, store_unit
from illumcli.baking.work import Compute, Result, WorkUnit, run_units
from illumcli.files.journal import Journal
from illumcli.geometry.scene_geometry import triangle_corners
from illumcli.geometry.spatial_order import compact
from illumcli.progress import Progress
from illumcli.rays.sampling import hashed, shuffled, spiral_draws, stream, unit_interval
from illumcli.records import Record
from illumcli.visibility.obscurance import estimates
from illumcli.visibility.obscurance_error import Errors, Estimates
from illumcli.visibility.open_hemisphere import trial_planes, triangle_planes
from illumcli.visibility.samplers import SAMPLERS

UNIT_RAYS = 1 << 18
"""Rays of a unit of work: an interrupt loses at most this, and there are enough units to share."""
UNIT_TRIANGLES = 1 << 14
"""Triangles of a unit of work that tests which of them are open."""
PAIR_SHARE, MIN_PAIRS = 100, 512
"""The error is estimated at one point in `PAIR_SHARE`, but at `MIN_PAIRS` at least."""
PILOT_SAMPLES = 16
AIM = 0.94
"""Error to aim at, as a share of the target error: errors are known to some 4 %."""
MAX_ROUNDS = 6
MIN_SAMPLES, MAX_SAMPLES = 8, 65536


class RayCounts(Record):
    """The number of rays that each of K points casts."""

    points: NDArray[np.int64]  # (K,) their indices
    samples: NDArray[np.int64]  # (K,)

    def at(self, index: NDArray[np.int64]) -> RayCounts:
        """The counts of some of the points."""
        return RayCounts(self.points[index], self.samples[index])


class PointEstimates(Record):
    """Estimates at K points, and the rays they took."""

    values: Estimates
    rays: int
    resumed: int = 0  # of these, rays that an earlier run cast


class ErrorEstimate(Record):
    """The error law of a bake, and the rays it took."""

    law: Errors
    rays: int


class ChosenSamples(Record):
    """Rays for a target error, and the rays it took to choose them."""

    samples: NDArray[np.int64]  # (K,)
    pilot_rays: int
    error_rays: int


class BakeSampler(Record):
    """Estimates a mean over hemispheres at the points of a bake."""

    points: Points
    occluders: Sequence[Occluders]  # per object
    measure: Measure
    seed: int
    threads: int
    progress: Progress
    is_dithered: bool = False  # so that errors of neighbouring results tend to cancel

    def open_points(self) -> NDArray[np.bool_]:
        """(M,) True for points with no geometry on that side of the triangles that their rays leave."""
        geometry = self.points.geometry
        a, b, c = triangle_corners(geometry.vertices, geometry.triangles)
        area = cross(b - a, c - a)
        sound = np.flatnonzero(dot(area, area) > 0)
        by_object = sound[np.argsort(geometry.objects[sound], kind="stable")]
        begins = np.flatnonzero(np.diff(geometry.objects[by_object], prepend=-1))
        objects = np.split(by_object, begins[1:]) if len(sound) else []

        def planes_of(triangle: NDArray[np.int64]) -> tuple[Vectors, Vectors]:
            of = triangle.astype(np.int32)
            is_inside = np.full(len(of), self.measure.side < 0)
            return triangle_planes(geometry, geometry.objects.take(of), of, is_inside)

        # Units of neighbouring triangles of the objects where some seem to be open.
        units = []
        for triangles in objects:
            owner = int(geometry.objects[triangles[0]])
            if not self.occluders[owner].clusters.is_promising(*planes_of(trial_planes(triangles))):
                continue
            ordered = triangles[compact((a + b + c)[triangles])]
            units += [
                WorkUnit(ordered[first : first + UNIT_TRIANGLES], UNIT_RAYS // UNIT_TRIANGLES, owner)
                for first in range(0, len(ordered), UNIT_TRIANGLES)
            ]

        def compute(unit: WorkUnit, stop: threading.Event) -> NDArray[np.bool_]:
            clusters = self.occluders[unit.object].clusters
            return clusters.is_open(len(unit.points), lambda index: planes_of(unit.points[index]))

        open_triangles = np.zeros(len(geometry.triangles), bool)
        for index, is_open in self._run("horizon", units, compute):
            open_triangles[units[index].points] = is_open
        return self.points.open_points(open_triangles)

    def estimate(
        self,
        purpose: str,
        counts: RayCounts,
        replicate: int,
        bent: bool = False,
        journal: Journal | None = None,
    ) -> PointEstimates:
        """Estimates at some points, each from its own number of rays.

        Parameters
        ----------
        purpose : str
            Shown as progress.
        replicate : int
            Every number gives an independent scramble; results have number 0.
        bent : bool
            Also compute the mean unoccluded direction.
        journal
            Units in it are not computed, and finished units are added to it.
        """
        count, side = len(self.points.key), self.measure.side
        out = Estimates(np.ones(count, F), np.zeros(count, F), np.zeros((count, 3), F) if bent else None)

        def compute(unit: WorkUnit, stop: threading.Event) -> tuple[Estimates, int]:
            draws = self._draws(unit.points, replicate)
            sampler = self.measure.method.sampler
            hemispheres = self.points.hemispheres(unit.points, draws[2], unit.samples, sampler, side)
            occluders = self.occluders[unit.object]
            tracer = occluders.tracer.counting(stop)
            normals = None if occluders.normals is None else F(side) * occluders.normals
            method = replace(self.measure.method, samples=unit.samples, triangle_normals=normals)
            return estimates(tracer, hemispheres, draws[:2], method, bent=bent), tracer.rays

        # Copy the units that an earlier run finished from the journal.
        due: list[WorkUnit] = []
        resumed = 0
        for unit in self._units(counts):
            stored = None if journal is None else load_unit(journal, unit, out)
            resumed += stored or 0
            due += [unit] if stored is None else []

        # Compute the others.
        total = resumed
        for index, (values, rays) in self._run(purpose, due, compute):
            points = due[index].points
            out.w[points], out.neighbor_variation[points] = values.w, values.neighbor_variation
            if out.bent is not None and values.bent is not None:
                out.bent[points] = values.bent
            total += rays
            if journal is not None:
                store_unit(journal, due[index], out, rays)
        at = counts.points
        mean = None if out.bent is None else out.bent[at]
        return PointEstimates(Estimates(out.w[at], out.neighbor_variation[at], mean), total, resumed)

    def errors(self, counts: RayCounts, replicate: int) -> ErrorEstimate:
        """The error law of the points, from pairs of scrambles at a few of them.

        The scrambles are numbered from `replicate` on. None of their rays is part of a result.
        """
        if not len(counts.points):
            return ErrorEstimate(Errors(0.0, 0.0, 0.0, 0), 0)

        # Choose a few points at random.
        count = max(-(-len(counts.points) // PAIR_SHARE), MIN_PAIRS)
        few = shuffled(stream(self.seed, "ao pairs"), self.points.key[counts.points])[:count]
        few.sort()

        # Estimate pairs of values there, several pairs if the points are few.
        halves: list[list[Estimates]] = [[], []]
        rounds = -(-MIN_PAIRS // len(few))
        rays = 0
        for number in range(rounds):
            for half in (0, 1):
                half_estimate = self.estimate("errors", counts.at(few), replicate + 2 * number + half)
                halves[half].append(half_estimate.values)
                rays += half_estimate.rays
        a, b = (
            Estimates(
                np.concatenate([each.w for each in half]),
                np.concatenate([each.neighbor_variation for each in half]),
            )
            for half in halves
        )
        return ErrorEstimate(Errors.of_pairs(a, b, np.tile(counts.samples[few], rounds)), rays)

    def samples_for(self, points: NDArray[np.int64], share: float, target: float) -> ChosenSamples:
        """Rays of each point for a root mean square error of `target` over all points, of which `points` are
        the `share` that is not open; with the fewest rays in all.

        A pilot of few rays estimates the error at each point: with L the neighbour variation around it, its
        variance is L N^-3/2, and the sum of N at a given sum of variances is least where N is proportional to
        L^(2/5). Pairs of scrambles then measure the error at these counts. All these rays are discarded:
        counts do not depend on the values that are kept, so the estimate stays unbiased.

        References
        ----------
        Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91.
        """
        if not len(points):
            return ChosenSamples(np.zeros(0, np.int64), 0, 0)

        # Estimate the errors by a pilot.
        pilot = self.estimate("pilot", RayCounts(points, np.full(len(points), PILOT_SAMPLES)), 1)
        near = averaged_along(self.points.order, points, pilot.values.neighbor_variation)
        weight = (1 + near) ** 0.4
        aim = AIM * target / np.sqrt(share)
        scale = float((np.mean(weight) * 0.1 * PILOT_SAMPLES**-0.5 / aim**2) ** (2 / 3))

        # Scale the counts until the measured error is in a narrow band below the aim.
        first, rays = 2, 0
        for _ in range(MAX_ROUNDS):
            samples = rounded_samples(weight * scale)
            measured = self.errors(RayCounts(points, samples), first)
            reached, rays = measured.law.rmse, rays + measured.rays
            first += 2 * MIN_PAIRS
            at_bound = samples.min() == MAX_SAMPLES or samples.max() == MIN_SAMPLES
            if 0.9 * aim <= reached <= aim or at_bound:
                break
            # Scale towards the middle of the band.
            scale *= float(np.clip((reached / (0.97 * aim)) ** (4 / 3), 0.05, 20.0))
        return ChosenSamples(samples, pilot.rays, rays)

    def _draws(self, points: NDArray[np.int64], replicate: int) -> NDArray[np.float64]:
        """(3, K) random numbers of some points: rotation and phase of their patterns, and what divides their
        rays among origins."""
        keys = [stream(self.seed, f"ao {what} {replicate}") for what in ("turn", "phase", "share")]
        draws = np.stack([unit_interval(hashed(key, self.points.key[points])) for key in keys])
        if self.is_dithered and replicate == 0 and SAMPLERS[self.measure.method.sampler].turned:
            # only results: the errors of other scrambles must be independent
            draws[:2] = spiral_draws(keys[0], self.points.rank[points])
        return draws

    def _units(self, counts: RayCounts) -> Iterator[WorkUnit]:
        """Units of neighbouring points of one object that cast the same number of rays in one way."""
        purpose = f"{self.points.kind} {self.measure.channel}"
        # Group them, along their order.
        along = np.argsort(self.points.rank[counts.points])
        order, samples = counts.points[along], counts.samples[along]
        objects, is_flat = self.points.objects[order].astype(np.int64), self.points.is_flat[order]
        kind = (objects * (MAX_SAMPLES + 1) + samples) * 2 + is_flat
        by_kind = np.argsort(kind, kind="stable")
        begins = np.flatnonzero(np.diff(kind[by_kind], prepend=-1))

        for places in np.split(by_kind, begins[1:]) if len(order) else ():
            count, owner = int(samples[places[0]]), int(objects[places[0]])
            size = max(1, UNIT_RAYS // count)
            for first in range(0, len(places), size):
                yield WorkUnit(order[places[first : first + size]], count, owner, purpose)

    def _run(
        self, purpose: str, units: Sequence[WorkUnit], compute: Compute[Result]
    ) -> Iterator[tuple[int, Result]]:
        return run_units(purpose, units, compute, self.threads, self.progress)


def averaged_along(
    order: NDArray[np.int64], points: NDArray[np.int64], values: NDArray[np.float32]
) -> NDArray[np.float64]:
    """(K,) mean of the values over each point and its four neighbours to either side along the order."""
    count = len(order)
    scattered, known = np.zeros(count), np.zeros(count)
    scattered[points], known[points] = values, 1
    kernel = np.ones(9)
    sums = np.convolve(scattered[order], kernel, "full")[4 : 4 + count]
    weights = np.convolve(known[order], kernel, "full")[4 : 4 + count]
    out = np.zeros(count)
    out[order] = sums / np.maximum(weights, 1)
    return out[points]


def rounded_samples(samples: NDArray[np.float64]) -> NDArray[np.int64]:
    """Numbers of rays in steps of a quarter octave: few different point sets, large units of work."""
    bounded = np.clip(samples, MIN_SAMPLES, MAX_SAMPLES)
    steps = np.rint(2 ** (np.rint(4 * np.log2(bounded)) / 4))
    return np.clip(steps, MIN_SAMPLES, MAX_SAMPLES).astype(np.int64)
