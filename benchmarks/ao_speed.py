"""How much does a bake cost beyond its rays?

Question   Time of a bake at 256 rays a vertex against replaying the very same rays through embreex
           alone, on as many threads; and what the order of the vertices and the size of a call are
           worth.
Reference  embreex `run` on arrays that are ready, in the order the bake has them, in calls of as many
           rays.
Repeats    Both in turn within one process, the best of REPEATS; only the ratio counts.

    python benchmarks/ao_speed.py MESH
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from ao_error import caster
from illumcli.baking.sampling import RayCounts
from illumcli.rays.ray_loop import NO_LIMIT
from illumcli.rays.sampling import hashed, stream, unit_interval
from illumcli.rays.single_ray_loop import SingleRayLoop
from illumcli.visibility import obscurance
from illumcli.visibility.hemisphere import hemisphere_rays

REPEATS = 5
SAMPLES = 256


def main() -> None:
    path = Path(sys.argv[1])
    bake, lanes = caster(path)
    threads = len(os.sched_getaffinity(0))
    samples = np.full(len(lanes), SAMPLES)
    geometry = bake.points.geometry
    scene = SingleRayLoop(geometry.vertices, geometry.triangles)
    order = bake.points.order[np.isin(bake.points.order, lanes)]
    keys = [stream(bake.seed, f"ao {what} 0") for what in ("turn", "phase", "share")]
    at_once = max(1, obscurance.RAYS_AT_ONCE // SAMPLES)

    def prepared(order: np.ndarray, at_once: int) -> list[tuple[np.ndarray, np.ndarray]]:
        calls, sampler, flat = [], bake.measure.method.sampler, bake.points.is_flat[order]
        parts = [
            some[first : first + at_once]
            for some in (order[~flat], order[flat])
            for first in range(0, len(some), at_once)
        ]
        for part in parts:
            draws = np.stack([unit_interval(hashed(key, bake.points.key[part])) for key in keys])
            over = bake.points.hemispheres(part, draws[2], SAMPLES, sampler)
            rays = hemisphere_rays(over, draws[:2], SAMPLES, sampler)
            calls.append((np.ascontiguousarray(rays.starts()), np.ascontiguousarray(rays.directions())))
        return calls

    def replay(calls: list[tuple[np.ndarray, np.ndarray]]) -> float:
        def one(call: tuple[np.ndarray, np.ndarray]) -> None:
            scene.occluded(*call, np.asarray(NO_LIMIT))

        start = time.perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(one, calls, chunksize=8))
        return time.perf_counter() - start

    ready = prepared(order, at_once)
    best = {"bake": np.inf, "replay": np.inf}
    spent = {"bake": np.inf, "replay": np.inf}
    for _ in range(REPEATS):
        for name, run in (
            ("bake", lambda: bake.estimate("values", RayCounts(lanes, samples), 0)),
            ("replay", lambda: replay(ready)),
        ):
            start, busy = time.perf_counter(), time.process_time()
            run()
            best[name] = min(best[name], time.perf_counter() - start)
            spent[name] = min(spent[name], time.process_time() - busy)
    rays = len(lanes) * SAMPLES
    print(f"{path.name}: {rays} rays, {threads} threads")
    for what, found in (("wall", best), ("processor", spent)):
        ratio = found["bake"] / found["replay"]
        print(f"  {what:9s} bake {found['bake']:.3f} s, replay {found['replay']:.3f} s, ratio {ratio:.3f}")
    part = len(order) // 4
    scattered = np.random.default_rng(0).permutation(order)[:part]
    kinds = {
        **{
            f"compact, {size} rays a call": (order[:part], size)
            for size in (1 << 12, 1 << 14, 1 << 15, 1 << 17)
        },
        "file's order": (np.sort(order)[:part], 1 << 15),
        "no order": (scattered, 1 << 15),
    }
    calls = {name: prepared(lanes, max(1, size // SAMPLES)) for name, (lanes, size) in kinds.items()}
    found = dict.fromkeys(kinds, np.inf)
    for _ in range(REPEATS):
        for name in kinds:
            found[name] = min(found[name], replay(calls[name]))
    for name, seconds in found.items():
        print(f"  {seconds / part / SAMPLES * 1e9:6.0f} ns a ray  {name}")


if __name__ == "__main__":
    main()
