"""How long do others take for the ambient occlusion of a mesh's vertices, and how far off are they?

Question   Seconds and error at equal rays, and seconds at equal error where the quantity is the same.
Others     libigl (Embree; uniform directions, so another quantity without the cosine weight: time only),
           PyMeshLab (CPU filter: sum over faces, then vertices, of shared directions: time only), Open3D
           (a script over RaycastingScene with independent cosine-weighted rays: the same quantity).
Reference  REFERENCE rays at VERTICES vertices.
Repeats    In turn within one process, the best of REPEATS. Needs `pip install libigl pymeshlab open3d`,
           in an environment of its own.

    python benchmarks/ao_peers.py MESH
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ao_error import caster

RAYS = 256
REFERENCE = 8192
VERTICES = 400
REPEATS = 3


def main() -> None:
    path = Path(sys.argv[1])
    bake, lanes = caster(path)
    few = np.sort(np.random.default_rng(0).permutation(lanes)[:VERTICES])
    truth = bake.cast("reference", few, np.full(len(few), REFERENCE), 1 << 30).w.astype(float)
    around = bake.occluders[0]
    origins = np.ascontiguousarray(bake.points.origins)
    n = np.ascontiguousarray(bake.points.n)
    vertices, faces = world_arrays(path)
    runs: dict[str, Callable[[], np.ndarray | None]] = {
        "illum, 256 rays": lambda: ours(bake, lanes, RAYS),
        **others(path, vertices, faces, origins, n),
    }
    best = dict.fromkeys(runs, np.inf)
    values: dict[str, np.ndarray | None] = {}
    for _ in range(REPEATS):
        for name, run in runs.items():
            start = time.perf_counter()
            values[name] = run()
            best[name] = min(best[name], time.perf_counter() - start)
    cores = len(os.sched_getaffinity(0))
    print(f"{path.name}: {len(origins)} vertices, {around.tracer.triangle_count} triangles, {cores} cores")
    base = best["illum, 256 rays"]
    for name, seconds in best.items():
        found = values[name]
        error = "" if found is None else f"  RMSE {np.sqrt(np.mean((found[few] - truth) ** 2)):.5f}"
        print(f"  {name:44s} {seconds:8.3f} s  {seconds / base:6.2f} times ours{error}")


def ours(bake, lanes: np.ndarray, rays: int) -> np.ndarray:
    """Values at every vertex point."""
    w = np.ones(len(bake.points.number))
    w[lanes] = bake.cast("values", lanes, np.full(len(lanes), rays), 0).w
    return w


def world_arrays(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The triangles as they are cast at."""
    from illumcli.jobs.ao_bake import bare, world_of

    loaded = bare(path, ())
    world = world_of(loaded.scene, loaded)
    return np.ascontiguousarray(world.vertices), np.ascontiguousarray(world.triangles)


def others(path: Path, vertices, faces, origins, n) -> dict[str, Callable[[], np.ndarray | None]]:
    """Those that are installed."""
    runs: dict[str, Callable[[], np.ndarray | None]] = {}
    try:
        import igl.embree

        v, f = vertices.astype(float), faces.astype(np.int64)

        def libigl() -> None:
            igl.embree.ambient_occlusion(v, f, origins.astype(float), n.astype(float), RAYS)

        runs["libigl, 256 rays"] = libigl
    except ImportError as why:
        print(f"no libigl: {why}")
    try:
        import pymeshlab

        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(vertices.astype(float), faces.astype(np.int32)))

        def pymeshlab_filter() -> None:
            meshes.compute_scalar_ambient_occlusion(rays=RAYS)

        runs["PyMeshLab, 256 rays"] = pymeshlab_filter
    except ImportError as why:
        print(f"no PyMeshLab: {why}")
    try:
        import open3d

        scene = open3d.t.geometry.RaycastingScene(nthreads=len(os.sched_getaffinity(0)))
        scene.add_triangles(vertices, faces.astype(np.uint32))
        rng = np.random.default_rng(1)

        def open3d_script(rays: int) -> np.ndarray:
            out = np.empty(len(origins))
            size = 1 << 12
            for first in range(0, len(origins), size):
                m = n[first : first + size]
                d = rng.normal(size=(len(m), rays, 3)).astype(np.float32)
                d /= np.linalg.norm(d, axis=2, keepdims=True)
                d += m[:, None]  # a unit vector plus the normal is cosine-weighted
                o = np.broadcast_to(origins[first : first + size, None], d.shape)
                hit = scene.test_occlusions(open3d.core.Tensor(np.concatenate([o, d], axis=2)))
                out[first : first + size] = 1 - hit.numpy().mean(axis=1)
            return out

        runs["Open3D script, 256 rays"] = lambda: open3d_script(RAYS)
        runs["Open3D script, 3584 rays (our error)"] = lambda: open3d_script(14 * RAYS)
    except ImportError as why:
        print(f"no Open3D: {why}")
    return runs


if __name__ == "__main__":
    main()
