"""How much faster is a render on two threads, and on all, than on one?

Reference: the same render with `-t 1`, in the same process, with a scene read anew: the obscurance-bound one
of `replay.py`, and one bound by shading. A machine that does other things meanwhile shows less than there is:
see the load, and the same ratio of sums that hold no lock, which is what the machine gives.

    OPENBLAS_NUM_THREADS=1 PYTHONPATH=src python benchmarks/threads.py [--small]
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from _bench import SMALL, ambient_scene, header, interleaved, lit_scene, ratio, table
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene


def numbers(threads: int) -> Callable[[], object]:
    """The same sums on so many threads, the interpreter's lock not held."""
    work = np.random.default_rng(0).random((8, 10_000 if SMALL else 200_000))

    def loop() -> None:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(lambda row: [np.sin(row) for _ in range(8)], work))

    return loop


def main() -> None:
    header("How much faster is a render on more threads?")
    counts = sorted({1, 2, len(os.sched_getaffinity(0))})
    large = (48, 27) if SMALL else (1280, 720)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        scenes = {
            "obscurance": (ambient_scene(folder, *large, 2 if SMALL else 64), ["obscurance"]),
            "two lights": (lit_scene(folder, *large, 1 if SMALL else 4), ["beauty"]),
        }
        for title, (scene, only) in scenes.items():
            runs = {
                f"{title}, -t {n}": lambda scene=scene, only=only, n=n: render_scene(
                    RenderJob(scene, RenderOptions(only=only, threads=n, force=True, cache=False))
                )
                for n in counts
            }
            times = interleaved(runs)
            table(times)
            for n in counts[1:]:
                ratio(f"{title}: 1 thread / {n}", times, f"{title}, -t 1", f"{title}, -t {n}")
        times = interleaved({f"sines, {n}": numbers(n) for n in counts})
        for n in counts[1:]:
            ratio(f"what the machine gives: 1 thread / {n}", times, "sines, 1", f"sines, {n}")


if __name__ == "__main__":
    main()
