"""How far does w jump across edges whose interpolated normals agree?

Question   How much less does w jump there about these normals than about the polygons' own?
Reference  The jump about the polygon's own normal (`about: geometric`), at the same points by as many rays.
Repeats    EDGES edges drawn by a fixed seed among those between two polygons whose interpolated normals
           agree within AGREE and whose planes do not; w is asked for on both sides of the middle, off the
           edge by INSIDE of the triangle's height. `noise` is the mean jump between two scrambles.

    PYTHONPATH=src python benchmarks/ao_facets.py [--small] MESH...
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from _bench import SMALL, header
from illumcli.arrays import F, column_major, dot, length, take_rows, unit
from illumcli.baking.loading import mesh_alone
from illumcli.rays.corner_weights import corner_weights
from illumcli.rays.interaction import Hits, ShadingContext, SurfaceInteraction, interact
from illumcli.render_graph.build import build
from illumcli.shading.rates import obscurance_normals
from illumcli.visibility.falloffs.step import Step
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.obscurance import Method, estimates
from illumcli.visibility.shadows import ray_origins

EDGES = 20 if SMALL else 1000
RAYS = 64 if SMALL else 2048
AGREE = 0.02  # [rad]
INSIDE = 1e-3


def shared_edges(triangles: np.ndarray) -> np.ndarray:
    """(E, 2) numbers 3 t + k of both sides of every edge between two triangles; side k faces corner k."""
    ends = np.sort([np.roll(triangles, -1 - k, axis=1)[:, :2] for k in range(3)], axis=2)  # (3, T, 2)
    sides = ends.transpose(1, 0, 2).reshape(-1, 2).astype(np.int64)
    key = sides[:, 0] * (triangles.max() + 1) + sides[:, 1]
    at = np.argsort(key, kind="stable")
    first = np.flatnonzero(key[at][:-1] == key[at][1:])
    return np.stack([at[first], at[first + 1]], axis=1)


def beside(geometry: Any, side: np.ndarray) -> tuple[Hits, SurfaceInteraction]:
    """Points just inside triangles, beside the middle of a side, seen from in front."""
    triangle, k = np.divmod(side, 3)
    weights = np.full((len(side), 3), (1 - INSIDE) / 2, F)
    weights[np.arange(len(side)), k] = INSIDE
    u, v = weights[:, 1], weights[:, 2]
    triangle = triangle.astype(np.int32)
    corner = [
        column_major(take_rows(geometry.vertices, geometry.triangles[triangle, k]), np.float64)
        for k in range(3)
    ]
    front = unit(np.cross(corner[1] - corner[0], corner[2] - corner[0]))
    objects = geometry.objects[triangle]
    hits = Hits(np.arange(len(side), dtype=np.int32), objects, triangle, u, v)
    return hits, interact(geometry, objects, triangle, u, v, column_major(front, np.float64))


def jumps(path: Path) -> tuple[int, float, float, float]:
    """Edges, and the mean jump of w about geometric and about shading normals, and of nothing but noise."""
    loaded = mesh_alone(path)
    made: dict[str, Any] = {}
    buffers = ["geometry", "tracer", "corner_normals", "planar_polygons"]
    for step in build(loaded.scene, loaded).topological_order(buffers):
        made[step.output] = step.run(made)
    geometry = made["geometry"]
    sides = []
    for side in shared_edges(geometry.triangles).T:
        hits, facet = beside(geometry, side)
        weights = corner_weights(geometry, hits, made["planar_polygons"])
        context = ShadingContext(geometry, weights, facet, made["corner_normals"])
        n = obscurance_normals(["phong"], context)
        sides.append((hits, facet, n))
    (_, left, n), (_, right, m) = sides
    polygon = [geometry.polygons[hits.triangle] for hits, _, _ in sides]
    sound = (length(left.ng) > 0.5) & (length(right.ng) > 0.5) & (polygon[0] != polygon[1])
    smooth = np.flatnonzero(sound & (length(n - m) < AGREE) & (dot(left.ng, right.ng) < 1 - 1e-6))
    few = np.sort(np.random.default_rng(0).permutation(smooth)[:EDGES])

    method = Method(RAYS, Step(), geometry.render_space.radius)
    found = []
    for seed, (_, facet, normal) in enumerate([*sides, sides[0]]):
        own = SurfaceInteraction(*(take_rows(values, few) for values in vars(facet).values()))
        origins, draws = ray_origins(own), np.random.default_rng(seed).random((2, len(few)))
        about = Hemispheres(own.ng, origins), Hemispheres(take_rows(normal, few), origins, own.ng)
        found.append([estimates(made["tracer"], over, draws, method).w for over in about])
    geometric, shading = (float(np.abs(found[0][k] - found[1][k]).mean()) for k in (0, 1))
    return len(few), geometric, shading, float(np.abs(found[0][1] - found[2][1]).mean())


def main() -> None:
    header(
        "How far does w jump across edges whose interpolated normals agree, about these and the polygons'?",
        edges=EDGES, rays=RAYS,
    )  # fmt: skip
    print(f"{'mesh':24} {'edges':>6} {'geometric':>10} {'shading':>10} {'ratio':>7} {'noise':>8}")
    for path in (Path(word) for word in sys.argv[1:] if not word.startswith("--")):
        count, polygons, own, noise = jumps(path)
        print(f"{path.name:24} {count:6} {polygons:10.4f} {own:10.4f} {own / polygons:7.2f} {noise:8.4f}")


if __name__ == "__main__":
    main()
