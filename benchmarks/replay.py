"""What does a whole obscurance-bound render cost beside its own rays alone?

Reference: the same rays, recorded where the renderer traces them singly, put to embreex's own scene in the
same chunks by as many threads: no generation, no checks, no shading, no files. The rays are recorded a row of
tiles at a time and then replayed, nothing else running, so that they need not all fit in memory. Seeds 1, 2,
...: no hit that was kept is met again. The command sets OPENBLAS_NUM_THREADS itself.

    OPENBLAS_NUM_THREADS=1 PYTHONPATH=src python benchmarks/replay.py [--small] [RAYS_PER_PIXEL]
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from _bench import REPEATS, SMALL, Took, ambient_scene, header, planned, ratio, table, took
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.film.tiles import Tile
from illumcli.rays.single_ray_loop import SingleRayLoop
from illumcli.render_graph import execute
from illumcli.scene.load import load

Question = tuple[str, np.ndarray, np.ndarray, Any]


def recorded(path: Path, threads: int) -> Iterable[tuple[Any, list[Question]]]:
    """The world and the questions of every band of tiles, as the renderer asks them."""
    os.environ["ILLUM_PACKETS"] = "0"  # packets form their rays in C, where no record can be taken
    loaded = load(path)
    steps = planned(loaded, ["obscurance"])
    shared = execute.run_once(steps, execute.Run())
    asked: list[Question] = []
    own = {name: getattr(SingleRayLoop, name) for name in ("closest", "distance", "occluded")}

    def recording(name: str) -> Any:
        def question(self: SingleRayLoop, origins: np.ndarray, directions: np.ndarray, *more: Any) -> Any:
            each = len(directions) // max(len(origins), 1)
            starts = np.repeat(np.array(origins, order="C"), each, axis=0)
            asked.append((name, starts, np.array(directions, order="C"), more))
            return own[name](self, origins, directions, *more)

        return question

    try:
        for name in own:
            setattr(SingleRayLoop, name, recording(name))
        view = steps.view
        side = steps.tile_side(view)
        for y in range(0, view.height, side):
            tiles = [
                Tile(x, y, min(side, view.width - x), min(side, view.height - y))
                for x in range(0, view.width, side)
            ]
            x, rows = (np.concatenate(part) for part in zip(*(tile.pixels() for tile in tiles), strict=True))
            execute.at_pixels(steps, shared, execute.Run(threads=threads), x, rows)
            yield shared["geometry"], asked[:]
            asked.clear()
    finally:
        del os.environ["ILLUM_PACKETS"]
        for name, function in own.items():
            setattr(SingleRayLoop, name, function)


def scene_of(geometry: Any) -> Any:
    """embreex's own scene over the world's triangles, built."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, np.ascontiguousarray(geometry.vertices), np.ascontiguousarray(geometry.triangles))
    probe = np.zeros((1, 3), np.float32)
    scene.run(probe, probe + np.float32(1), query="OCCLUDED")
    return scene


def ask(scene: Any, question: Question) -> None:
    """One recorded question, put to embreex."""
    name, origins, directions, more = question
    if name == "closest":
        scene.run(origins, directions, query="INTERSECT", output=1)
    elif name == "distance":
        scene.run(origins, directions, query="DISTANCE")
    else:
        far = np.broadcast_to(np.minimum(more[0] if more else np.inf, 1e37), len(origins))
        scene.run(origins, directions, far.astype(np.float32), query="OCCLUDED")


def replay(path: Path, threads: int) -> tuple[Took, int]:
    """Seconds that all rays of a render take alone, and their number."""
    wall = cpu = 0.0
    rays, scene = 0, None
    with ThreadPoolExecutor(threads) as pool:
        for geometry, questions in recorded(path, threads):
            scene = scene or scene_of(geometry)
            own = took(lambda s=scene, q=questions: list(pool.map(lambda each: ask(s, each), q)))
            wall, cpu = wall + own.wall, cpu + own.cpu
            rays += sum(len(question[1]) for question in questions)
    return Took(wall, cpu), rays


def main(rays: int, width: int, height: int) -> None:
    threads = len(os.sched_getaffinity(0))
    header(
        "What does a whole obscurance-bound render cost beside its own rays alone?",
        film=f"{width}x{height}", rays_per_pixel=rays, threads=threads,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        os.environ["ILLUM_CACHE"] = str(folder / "cache")
        scene = ambient_scene(folder, width, height, rays)
        times: dict[str, list[Took]] = {"whole render, in process": [], "its rays alone": []}
        render_scene(
            RenderJob(scene, RenderOptions(only=["obscurance"], force=True))
        )  # parsed meshes are kept from here on, as a user has them
        count = 0
        for seed in range(1, REPEATS + 1):
            whole = took(
                lambda seed=seed: render_scene(
                    RenderJob(scene, RenderOptions(only=["obscurance"], seed=seed, force=True))
                )
            )
            alone, count = replay(scene, threads)
            times["whole render, in process"].append(whole)
            times["its rays alone"].append(alone)
        print(f"# {count} rays")
        table(times)
        ratio("whole / rays alone", times, "whole render, in process", "its rays alone")


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    main(numbers[0] if numbers else (4 if SMALL else 64), *((48, 27) if SMALL else (1280, 720)))
