"""The rows of a table: units of work, each a pure function of the surface, the settings and its number."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.directions import LEAST_COSINE, AngleGrid
from illumcli.gonioreflectometer.estimate import REPLICATES, Estimate, of_replicates, to_target
from illumcli.gonioreflectometer.fresnel import fresnel_of
from illumcli.gonioreflectometer.lambert import LambertSettings, lambert_orders
from illumcli.gonioreflectometer.mirrors import Ring, mirrored_once, mirrored_to
from illumcli.gonioreflectometer.mirrors_again import mirrored_again
from illumcli.gonioreflectometer.settings import MeasureSettings
from illumcli.gonioreflectometer.surface import Surface
from illumcli.measured_files.merl import SHAPE, cell_directions
from illumcli.progress import Progress
from illumcli.rays.sampling import stream

BLOCK = 1 << 11
"""Cells that a thread does at once."""

Part: TypeAlias = Callable[[Bench], Estimate]


class Instrument:
    """A surface on its bench, and what is measured of it."""

    def __init__(self, surface: Surface, settings: MeasureSettings) -> None:
        self.surface, self.settings = surface, settings
        self._bench = Bench(surface)
        self._grid = None if settings.isotropic else AngleGrid(settings.step)
        self._fresnel = fresnel_of(settings.fresnel)

    def row(self, number: int, threads: int, progress: Progress) -> Estimate:
        """The cells of a row, in their order.

        Raises
        ------
        Interrupted
            Never here: threads that are at work end when the consumer stops.
        """
        parts, stop = self._parts(number), threading.Event()
        done: dict[int, Estimate] = {}
        with ThreadPoolExecutor(threads, thread_name_prefix="measure") as pool:
            try:
                futures = {
                    pool.submit(part, self._bench.counting(stop)): index for index, part in enumerate(parts)
                }
                for future in as_completed(futures):
                    done[futures[future]] = future.result()
                    progress("cells", len(done), len(parts))
            finally:
                stop.set()
                pool.shutdown(wait=True, cancel_futures=True)
        ordered = [done[index] for index in range(len(parts))]
        return Estimate(
            np.concatenate([each.values for each in ordered], axis=1),
            np.concatenate([each.errors for each in ordered], axis=1),
            max(each.samples for each in ordered),
            sum(each.rays for each in ordered),
        )

    def _parts(self, number: int) -> Sequence[Part]:
        if self._grid is not None:
            first = number * self._grid.around
            return [partial(self._of_incidence, first + step) for step in range(self._grid.around)]
        if number >= SHAPE[0]:
            return [partial(self._again, number)]
        blocks = [slice(first, first + BLOCK) for first in range(0, SHAPE[1] * SHAPE[2], BLOCK)]
        what = self._mirrors if self.settings.facets == "mirror" else self._lambert
        return [partial(what, number, block) for block in blocks]

    def _key(self, purpose: str, *numbers: int) -> tuple[int, ...]:
        return (stream(self.settings.seed, purpose), *numbers)

    def _lambert(self, row: int, block: slice, bench: Bench) -> Estimate:
        """Lambertian facets at the centres of cells of the table of half and difference angles."""
        l, v = (d[block] for d in cell_directions(row))
        return self._lambert_at(bench, l, v, (row, block.start))

    def _lambert_at(self, bench: Bench, l: Floats, v: Floats, place: tuple[int, int]) -> Estimate:
        settings = self.settings
        seen = np.flatnonzero((l[:, 2] > LEAST_COSINE) & (v[:, 2] > LEAST_COSINE))

        def attempt(samples: int, number: int) -> Estimate:
            key = self._key("lambert", *place, number)
            how = LambertSettings(settings.bounces, settings.isotropic, key)
            before = bench.rays
            orders = lambert_orders(bench, l[seen], v[seen], samples, how)
            albedo = np.array(settings.albedo)
            powers = albedo[:, None] ** np.arange(1, settings.bounces + 1)  # (3, bounces)
            most = albedo[:, None] / (np.pi * l[seen, 2] * samples)
            found = of_replicates(np.einsum("ck,knr->cnr", powers, orders), most, samples)
            values, errors = (_among(len(l), seen, each) for each in found)
            return Estimate(values, errors, samples, bench.rays - before)

        return to_target(attempt, settings.samples, settings.target_error, l[:, 2] * v[:, 2])

    def _mirrors(self, row: int, block: slice, bench: Bench) -> Estimate:
        """Mirror facets, once, in the cells of the table of half and difference angles."""
        settings = self.settings
        edges = (np.arange(row, row + 2) / SHAPE[0]) ** 2 * (np.pi / 2)
        centre = ((row + 0.5) / SHAPE[0]) ** 2 * (np.pi / 2)
        half_width = max(np.radians(settings.resolution), float(np.diff(edges)[0]) / 2)
        ring = Ring.of(self.surface, centre, half_width)
        theta_d = np.repeat((np.arange(SHAPE[1]) + 0.5) * (np.pi / 2 / SHAPE[1]), SHAPE[2])[block]
        phi_d = np.tile((np.arange(SHAPE[2]) + 0.5) * (np.pi / SHAPE[2]), SHAPE[1])[block]
        l, v = (d[block, 2] for d in cell_directions(row))
        most = ring.density / (4 * np.maximum(l, LEAST_COSINE) * np.maximum(v, LEAST_COSINE))
        fresnel = self._fresnel(np.cos(theta_d))

        def attempt(samples: int, number: int) -> Estimate:
            key, before = self._key("mirrors", row, block.start, number), bench.rays
            once = mirrored_once(bench, (self.surface, ring), (theta_d, phi_d), samples, key)
            values, errors = of_replicates(once, most / samples, samples)
            errors = np.where(np.isnan(values), np.nan, errors)
            return Estimate(fresnel * values, fresnel * errors, samples, bench.rays - before)

        return to_target(attempt, settings.samples, settings.target_error, l * v)

    def _again(self, number: int, bench: Bench) -> Estimate:
        """Light that mirror facets mirror several times: a replicate of all cells."""
        settings, before = self.settings, bench.rays
        key = self._key("again", number)
        values = mirrored_again(bench, (self._fresnel, settings.bounces), (settings.samples, key))
        return Estimate(values, np.zeros_like(values), settings.samples, bench.rays - before)

    def _of_incidence(self, cell: int, bench: Bench) -> Estimate:
        """All eyes of the grid, for light from the centre of one of its cells."""
        grid, settings = self._grid, self.settings
        assert grid is not None
        l = grid.directions[cell]
        if settings.facets == "lambert":
            return self._lambert_at(bench, np.tile(l, (len(grid), 1)), grid.directions, (cell, 0))

        def attempt(samples: int, number: int) -> Estimate:
            each, before = samples * len(grid) // REPLICATES, bench.rays
            light, draw = (self._fresnel, settings.bounces), (each, self._key("rays", cell, number))
            found = mirrored_to(bench, l, grid, light, draw)
            one = 1 / (grid.projected * each * REPLICATES)
            values, errors = of_replicates(found, np.broadcast_to(one, (3, len(grid))), 1)
            return Estimate(values, errors, samples, bench.rays - before)

        return to_target(attempt, settings.samples, settings.target_error, grid.directions[:, 2])


def row_count(settings: MeasureSettings) -> int:
    """Units of work of a table."""
    if not settings.isotropic:
        return AngleGrid(settings.step).polar
    several = settings.facets == "mirror" and settings.bounces > 1
    return SHAPE[0] + (REPLICATES if several else 0)


def _among(count: int, index: NDArray[np.intp], values: Floats) -> Floats:
    """(3, count) the values of some cells, NaN in the others."""
    out = np.full((3, count), np.nan)
    out[:, index] = values
    return out
