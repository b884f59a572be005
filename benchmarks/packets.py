"""What does a ray cost in packets of each width, and does any answer differ from that of a single ray?

Reference: embreex's loop over the same rays in the same order. The bunny of unit radius stands on a floor.
Kinds of rays: of a camera, from the points that it sees to a lamp, obscurance about these points (each loop
forms the directions), at random, at vertices, and off triangles in random directions. One thread, processor
time, the least of the rounds. A hit differs if its triangle, u, v or distance does.

    OPENBLAS_NUM_THREADS=1 PYTHONPATH=src python benchmarks/packets.py [--small] [RAYS]
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np

from _bench import REPEATS, SMALL, ambient_scene, header, planned
from illumcli.arrays import F, Vectors, column_major, cross, unit
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.packet_loop import PacketLoop, native_widths
from illumcli.rays.pattern_rays import PatternResults
from illumcli.rays.ray_loop import NO_LIMIT, Closest, RayLoop
from illumcli.rays.single_ray_loop import SingleRayLoop
from illumcli.render_graph import execute
from illumcli.scene.load import load
from illumcli.visibility.hemisphere import Hemispheres, hemisphere_rays

Rays: TypeAlias = tuple[Vectors, Vectors]
Answer: TypeAlias = Closest | np.ndarray
Ask: TypeAlias = Callable[[RayLoop], Answer]
EYE, TARGET, LAMP = (2.2, 1.6, 3.4), (0, 0.55, 0), (3.0, 4.0, 3.0)
OFFSET = 1e-6
UNLIMITED = np.asarray(NO_LIMIT)


def questions(geometry: SceneGeometry, single: RayLoop, count: int) -> Iterator[tuple[str, int, Ask]]:
    """What is asked, the number of rays, and how."""
    rng = np.random.default_rng(0)
    vertices, triangles = geometry.vertices, geometry.triangles
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    ng = unit(cross(b - a, c - a))

    # A square picture, and the points that it shows.
    eye, target, lamp = (geometry.render_space.from_world(place) for place in (EYE, TARGET, LAMP))
    side = round(count**0.5)
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, side), np.linspace(0.3, -0.3, side))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 1, 0])
    d = forward + x.reshape(-1, 1) * right + y.reshape(-1, 1) * np.cross(right, forward)
    camera = column_major(np.broadcast_to(eye, d.shape), F), column_major(d, F)
    hits = single.closest(*camera)
    seen = np.flatnonzero(hits.triangle >= 0)
    normal = ng[hits.triangle[seen]]
    normal = np.where(np.sum(normal * camera[1][seen], axis=1, keepdims=True) > 0, -normal, normal)
    point = eye + d[seen] * hits.distance[seen, None] + OFFSET * normal

    def closest(rays: Rays, coherent: bool = False) -> Ask:
        return lambda loop: loop.closest(*rays, coherent)

    def occluded(rays: Rays, coherent: bool = False) -> Ask:
        return lambda loop: loop.occluded(*rays, UNLIMITED, coherent)

    to_lamp = column_major(point, F), column_major(lamp - point, F)
    yield "camera, closest hit", len(d), closest(camera)
    yield "the same, coherent", len(d), closest(camera, True)
    yield "to a lamp, occlusion", len(seen), occluded(to_lamp, True)

    # Obscurance about the points.
    for samples in (16, 64, 256):
        few = np.sort(rng.permutation(len(seen))[: count // samples])
        over = Hemispheres(column_major(normal[few], F), column_major(point[few], F))
        rays = hemisphere_rays(over, rng.random((2, len(few))), samples, "spiral")

        def patterns(loop: RayLoop, rays=rays) -> np.ndarray:
            results = PatternResults.room(rays.shape)
            loop.trace_patterns(rays, float(NO_LIMIT), results)
            return results.open

        yield f"obscurance, {samples} a point", len(few) * samples, patterns

    # Rays without any order, about the bunny.
    size = 1 / geometry.render_space.radius
    centre = geometry.render_space.from_world((0, 0.7, 0))
    o = column_major(centre + 1.5 * size * rng.normal(size=(count, 3)), F)
    some = rng.integers(0, len(triangles) * 99 // 100, count)
    middle = (a + b + c)[some] / 3 + OFFSET * ng[some]
    scattered = ng[some] + 0.5 * rng.normal(size=(count, 3))
    kinds = {
        "at random": (o, column_major(centre + size * rng.uniform(-1, 1, (count, 3)) - o, F)),
        "at vertices": (o, column_major(a[some] - o, F)),
        "off triangles": (column_major(middle, F), column_major(scattered, F)),
    }
    for name, rays in kinds.items():
        yield f"{name}, closest hit", count, closest(rays)
        yield f"{name}, occlusion", count, occluded(rays)


def differences(answer: Answer, expected: Answer) -> int:
    """How many rays, or points, have another answer."""
    if not isinstance(answer, Closest):
        return int(np.count_nonzero(answer != expected))
    hit = expected.triangle >= 0
    others = answer.triangle != expected.triangle
    for name in ("u", "v", "distance"):
        others |= hit & (getattr(answer, name) != getattr(expected, name))
    return int(np.count_nonzero(others))


def main(count: int) -> None:
    header("What does a ray cost in packets, and does any answer differ?", rays_per_row=count)
    with tempfile.TemporaryDirectory() as name:
        steps = planned(load(ambient_scene(Path(name), 64, 64, 16)), ["obscurance"])
        geometry = execute.run_once(steps, execute.Run())["geometry"]
    made = geometry.vertices, geometry.triangles
    loops: dict[str, RayLoop] = {"embreex": SingleRayLoop(*made)}
    loops |= {str(width): PacketLoop(*made, width) for width in (1, *native_widths()[::-1])}
    print(f"{'ns a ray':28s}" + "".join(f"{name:>9s}" for name in loops) + f"{'differ':>9s}")
    asked = different = 0
    for what, rays, ask in questions(geometry, loops["embreex"], count):
        best = dict.fromkeys(loops, np.inf)
        answers = {}
        for _ in range(REPEATS):
            for name, loop in loops.items():
                start = time.process_time()
                answers[name] = ask(loop)
                best[name] = min(best[name], time.process_time() - start)
        expected = answers["embreex"]
        differ = sum(differences(answers[name], expected) for name in list(loops)[1:])
        asked, different = asked + rays * (len(loops) - 1), different + differ
        cells = "".join(f"{seconds / rays * 1e9:9.1f}" for seconds in best.values())
        print(f"{what:28s}{cells}{differ:9d}")
    print(f"{different} of {asked} answers differ")


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    main(numbers[0] if numbers else (1 << 12 if SMALL else 1 << 20))
