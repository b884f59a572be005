"""Casts the rays of a bake: pieces on threads, finished ones kept in a file, errors from fresh scrambles."""

from __future__ import annotations

import hashlib
import struct
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, column_major, cross, dot, take_rows
from illumcli.baking.points import Points
from illumcli.files.journal import Journal
from illumcli.geometry.spatial_order import compact
from illumcli.rays.embree import Tracer
from illumcli.rays.sampling import hashed, stream, unit_interval
from illumcli.records import Record, Value
from illumcli.visibility.obscurance import Method, estimates
from illumcli.visibility.obscurance_error import Errors, Estimates
from illumcli.visibility.open_hemisphere import ClusterTree, triangle_planes

RAYS = 1 << 18
"""Rays of a piece of work: an interrupt loses no more, and there are enough pieces to share."""
LANES = 1 << 14
PAIRS_SHARE, FEWEST_PAIRS = 100, 512
"""The error is learnt from one point in so many, and from so many at least."""
PILOT = 16
AIM = 0.94
"""What is aimed at, as a share of the error asked for: the error itself is known to some 4 %."""
ROUNDS = 6
FEWEST_SAMPLES, MOST_SAMPLES = 8, 65536

Progress = Callable[[str, int, int], None]


class Occluders(Record):
    """What the points of an object may be hidden by."""

    tracer: Tracer
    horizon: ClusterTree
    facets: NDArray[np.float32] | None = None  # (T, 3) unit normals, where back faces are told apart


class Cast(Record):
    """What was found at M points; those that are known to be open have w = 1 and no unevenness."""

    w: NDArray[np.float32]
    neighbor_variation: NDArray[np.float32]
    bent: NDArray[np.float32] | None = None


class WorkUnit(Value):
    """A unit of work: a function of the points it names and its own fields alone."""

    lanes: NDArray[np.int64]
    samples: int
    thing: int


@dataclass(slots=True, eq=False)
class BakeSampler:
    """The points of a bake and the means to cast from them."""

    points: Points
    occluders: Sequence[Occluders]  # per object
    method: Method
    seed: int
    threads: int
    progress: Progress
    rays: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    resumed: int = 0
    """Of the rays, those that an earlier run cast."""
    order: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.order = compact(self.points.position)

    def open(self) -> NDArray[np.bool_]:
        """(M,) True where nothing is above the triangles that a point's rays leave."""
        world = self.points.world
        corner = [
            column_major(take_rows(world.vertices, world.triangles[:, k]), np.float64) for k in range(3)
        ]
        area = cross(corner[1] - corner[0], corner[2] - corner[0])
        along = compact(corner[0] + corner[1] + corner[2])
        along = along[dot(area, area)[along] > 0]
        clear = np.zeros(len(area), bool)
        pieces = [
            WorkUnit(own[first : first + LANES], RAYS // LANES, number)
            for number in range(len(world.placed))
            if (own := along[world.objects[along] == number]).size
            for first in range(0, len(own), LANES)
        ]

        def ask(piece: WorkUnit, stop: threading.Event) -> NDArray[np.bool_]:
            triangle = piece.lanes.astype(np.int32)
            planes = triangle_planes(world, triangle, np.zeros(len(triangle), bool))
            return self.occluders[piece.thing].horizon.is_open(*planes)

        for number, found in self._run("horizon", pieces, ask):
            clear[pieces[number].lanes] = found
        return self.points.above(clear)

    def cast(
        self,
        purpose: str,
        lanes: NDArray[np.int64],
        samples: NDArray[np.int64],
        replicate: int,
        bent: bool = False,
        journal: Journal | None = None,
    ) -> Cast:
        """Estimates at some lanes with their own number of rays each.

        Parameters
        ----------
        samples : (K,) int
            Rays of each lane.
        replicate : int
            Every number is a scramble of its own; 0 is the one whose values are given out.
        """
        count = len(self.points.number)
        out = Cast(np.ones(count, F), np.zeros(count, F), np.zeros((count, 3), F) if bent else None)
        keys = [stream(self.seed, f"ao {what} {replicate}") for what in ("turn", "phase", "share")]
        pieces = list(self._pieces(lanes, samples))

        def ask(piece: WorkUnit, stop: threading.Event) -> tuple[Estimates, int]:
            number = self.points.number[piece.lanes]
            draws = np.stack([unit_interval(hashed(key, number)) for key in keys])
            over = self.points.hemispheres(piece.lanes, draws[2])
            around = self.occluders[piece.thing]
            tracer = around.tracer.counting(stop)
            method = replace(self.method, samples=piece.samples, facets=around.facets)
            return estimates(tracer, over, draws[:2], method, bent=bent), tracer.rays

        waiting = []
        for piece in pieces:
            rays = None if journal is None else _kept(journal, piece, out)
            if rays is None:
                waiting.append(piece)
            else:
                self.rays[purpose] += rays
                self.resumed += rays
        for number, (found, rays) in self._run(purpose, waiting, ask):
            piece = waiting[number]
            out.w[piece.lanes], out.neighbor_variation[piece.lanes] = found.w, found.neighbor_variation
            if out.bent is not None and found.bent is not None:
                out.bent[piece.lanes] = found.bent
            self.rays[purpose] += rays
            if journal is not None:
                _keep(journal, piece, out, rays)
        return Cast(
            out.w[lanes], out.neighbor_variation[lanes], None if out.bent is None else out.bent[lanes]
        )

    def errors(self, lanes: NDArray[np.int64], samples: NDArray[np.int64], replicate: int) -> Errors:
        """The error law of `lanes`, from pairs of scrambles numbered from `replicate` on, at a few of them.

        None of these rays is among those whose values are given out.
        """
        if not len(lanes):
            return Errors(0.0, 0.0, 0.0, 0)
        draw = hashed(stream(self.seed, "ao pairs"), self.points.number[lanes])
        few = np.argsort(draw, kind="stable")[: max(-(-len(lanes) // PAIRS_SHARE), FEWEST_PAIRS)]
        few = np.sort(few)
        halves: list[list[Cast]] = [[], []]
        rounds = -(-FEWEST_PAIRS // len(few))
        for again in range(rounds):
            for half in (0, 1):
                number = replicate + 2 * again + half
                halves[half].append(self.cast("errors", lanes[few], samples[few], number))
        a, b = (
            Estimates(
                np.concatenate([c.w for c in half]), np.concatenate([c.neighbor_variation for c in half])
            )
            for half in halves
        )
        return Errors.of_pairs(a, b, np.tile(samples[few], rounds))

    def samples_for(self, lanes: NDArray[np.int64], share: float, target: float) -> NDArray[np.int64]:
        """(K,) rays of each lane that reach a root mean square error of `target` over all points, of which
        `lanes` are the `share` that is not open; with the fewest rays in all.

        A pilot of few rays says where the error is: with L of a lane's neighbourhood its variance is
        L N^-3/2, and the sum of N at a given sum of variances is least where N goes with L^(2/5). Pairs of
        scrambles then measure what the counts reach. All these rays are thrown away: what is kept was not
        looked at when the counts were chosen, which keeps the estimate unbiased.

        References
        ----------
        Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91.
        """
        if not len(lanes):
            return np.zeros(0, np.int64)
        pilot = self.cast("pilot", lanes, np.full(len(lanes), PILOT), 1)
        near = _averaged_along(self.order, lanes, pilot.neighbor_variation, len(self.points.number))
        weight = (1 + near) ** 0.4
        aim = AIM * target / np.sqrt(share)
        scale = float((np.mean(weight) * 0.1 * PILOT**-0.5 / aim**2) ** (2 / 3))
        first = 2
        for _ in range(ROUNDS):
            samples = _steps(weight * scale)
            reached = self.errors(lanes, samples, first).rmse
            first += 2 * FEWEST_PAIRS
            if (
                0.9 * aim <= reached <= aim
                or samples.min() == MOST_SAMPLES
                or samples.max() == FEWEST_SAMPLES
            ):
                break
            # towards the middle of the band
            scale *= float(np.clip((reached / (0.97 * aim)) ** (4 / 3), 0.05, 20.0))
        return samples

    def _pieces(self, lanes: NDArray[np.int64], samples: NDArray[np.int64]) -> Iterator[WorkUnit]:
        """Lanes of one object and one number of rays, near each other."""
        rays = np.zeros(len(self.order), np.int64)
        rays[lanes] = samples
        thing = self.points.thing[self.order]
        along = rays[self.order]
        for own in np.unique(thing):
            for count in np.unique(along[(thing == own) & (along > 0)]):
                group = self.order[(along == count) & (thing == own)]
                size = max(1, RAYS // int(count))
                for first in range(0, len(group), size):
                    yield WorkUnit(group[first : first + size], int(count), int(own))

    def _run(
        self, what: str, pieces: Sequence[WorkUnit], ask: Callable[..., Any]
    ) -> Iterator[tuple[int, Any]]:
        """Results of `ask(piece, stop)` as they come; when the consumer stops, pieces in flight end soon."""
        stop = threading.Event()
        total = sum(len(piece.lanes) * piece.samples for piece in pieces)
        done = 0
        with ThreadPoolExecutor(self.threads, thread_name_prefix="bake") as pool:
            try:
                queue = iter(range(len(pieces)))
                pending: dict[Future[Any], int] = {}
                while True:
                    for number in queue:
                        pending[pool.submit(ask, pieces[number], stop)] = number
                        if len(pending) > self.threads:
                            break
                    if not pending:
                        break
                    # a short wait, so that an interrupt reaches this thread
                    finished = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED).done
                    for future in finished:
                        number = pending.pop(future)
                        yield number, future.result()
                        done += len(pieces[number].lanes) * pieces[number].samples
                        self.progress(what, done, total)
            finally:
                stop.set()
                pool.shutdown(wait=True, cancel_futures=True)


def _averaged_along(
    order: NDArray[np.int64], lanes: NDArray[np.int64], values: NDArray[np.float32], count: int
) -> NDArray[np.float64]:
    """(K,) mean of the values over each lane and its four neighbours to either side along the order."""
    whole, known = np.zeros(count), np.zeros(count)
    whole[lanes], known[lanes] = values, 1
    kernel = np.ones(9)
    sums = np.convolve(whole[order], kernel, "full")[4 : 4 + count]
    weights = np.convolve(known[order], kernel, "full")[4 : 4 + count]
    out = np.zeros(count)
    out[order] = sums / np.maximum(weights, 1)
    return out[lanes]


def _steps(samples: NDArray[np.float64]) -> NDArray[np.int64]:
    """Numbers of rays in steps of a quarter octave: few different patterns, long pieces."""
    bounded = np.clip(samples, FEWEST_SAMPLES, MOST_SAMPLES)
    return np.clip(np.rint(2 ** (np.rint(4 * np.log2(bounded)) / 4)), FEWEST_SAMPLES, MOST_SAMPLES).astype(
        np.int64
    )


def _key(piece: WorkUnit) -> bytes:
    """16 bytes that tell a piece from every other of its bake."""
    digest = hashlib.blake2b(struct.pack("<qq", piece.samples, piece.thing), digest_size=16)
    digest.update(np.ascontiguousarray(piece.lanes).data)
    return digest.digest()


def _kept(journal: Journal, piece: WorkUnit, out: Cast) -> int | None:
    """Copy what the journal has of a piece to `out`; the rays it took, None where it has nothing."""
    width = 2 if out.bent is None else 5
    found = journal.find(_key(piece))
    if found is None or len(found) != 8 + 4 * width * len(piece.lanes):
        return None
    rows = np.frombuffer(found, F, offset=8).reshape(-1, width)
    out.w[piece.lanes], out.neighbor_variation[piece.lanes] = rows[:, 0], rows[:, 1]
    if out.bent is not None:
        out.bent[piece.lanes] = rows[:, 2:]
    return int.from_bytes(found[:8], "little")


def _keep(journal: Journal, piece: WorkUnit, out: Cast, rays: int) -> None:
    """Add a finished piece to the journal."""
    parts = [out.w[piece.lanes, None], out.neighbor_variation[piece.lanes, None]]
    rows = np.concatenate(parts if out.bent is None else [*parts, out.bent[piece.lanes]], axis=1)
    journal.append(_key(piece), rays.to_bytes(8, "little") + np.ascontiguousarray(rows).tobytes())
