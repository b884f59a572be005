"""What does a model cost per shading point, relative to one shadow ray?

Reference: one Embree occlusion ray on an icosphere of 81,920 triangles, single precision, same run.
Seed 0, best of 7 repeats, 8192 points, default parameters unless a choice is named. Prints ns per point.

    PYTHONPATH=src:tests python benchmarks/model_cost.py [MODEL ...]
"""

from __future__ import annotations

import platform
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

import rgl_files
from illumcli.arrays import F, column_major, cross, unit
from illumcli.measured_files import merl
from illumcli.schema.families import member, tags
from illumcli.shading import terms

LANES, REPEATS = 8192, 7


def best(run: Callable[[], object]) -> float:
    """Nanoseconds per lane of the fastest of the repeats."""
    run()
    fastest = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        for _ in range(20):
            run()
        fastest = min(fastest, (time.perf_counter() - start) / 20)
    return fastest / LANES * 1e9


def lanes() -> dict[str, np.ndarray]:
    """Directions above a surface whose normal and tangent turn from lane to lane."""
    random = np.random.default_rng(0)
    n = unit(column_major(random.normal(size=(LANES, 3)), F))
    t = unit(cross(n, unit(column_major(random.normal(size=(LANES, 3)), F))))
    l, v = (unit(unit(column_major(random.normal(size=(LANES, 3)), F)) + n) for _ in range(2))
    return {"n": n, "l": l, "v": v, "t": t, "light": np.ones((LANES, 3), F, order="F")}


def icosphere(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the unit icosphere, 20 * 4^levels triangles that share no vertices."""
    g = (1 + 5**0.5) / 2
    ring = [(a * 1.0, b * g) for a in (-1, 1) for b in (-1, 1)]
    points = np.array(
        [(0, a, b) for a, b in ring] + [(a, b, 0) for a, b in ring] + [(b, 0, a) for a, b in ring]
    )
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < 2.1
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i)
        for k in range(j)
        if near[i, j] and near[j, k] and near[k, i]
    ]
    corners = points[np.array(faces)]
    for _ in range(levels):
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.concatenate(
            [np.stack(each, 1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
        corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    return corners.reshape(-1, 3).astype(F), np.arange(corners.size // 3, dtype=np.int32).reshape(-1, 3)


def occlusion_ray() -> Callable[[], object]:
    """One occlusion question for every lane, from just above the sphere into the hemisphere."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    vertices, triangles = icosphere(6)
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, vertices, triangles)
    given = lanes()
    origins, directions = np.ascontiguousarray(given["n"] * F(1.001)), np.ascontiguousarray(given["l"])
    return lambda: scene.run(origins, directions, query="OCCLUDED")


def measurements(folder: str) -> dict[str, str]:
    """Paths of files of noise, as large as real ones, by the model that reads them."""
    random = np.random.default_rng(0)
    with open(f"{folder}/noise.binary", "wb") as file:
        file.write(merl.encode(random.random((3, *merl.SHAPE))))
    fields = rgl_files.measurement(
        *random.random((2, 128)) + 0.1, random.random((8, 128, 128)), random.random((8, 3, 32, 32))
    )
    with open(f"{folder}/noise.bsdf", "wb") as file:
        file.write(rgl_files.tensor_file(fields))
    return {"merl": f"{folder}/noise.binary", "rgl": f"{folder}/noise.bsdf"}


def main(measured: dict[str, str]) -> None:
    given = lanes()
    print(f"# numpy {np.__version__}, {platform.machine()}, {LANES} lanes, best of {REPEATS}")
    print(f"{'one occlusion ray':28s} {best(occlusion_ray()):8.1f} ns")
    for tag in sys.argv[1:] or tags("illumcli.models"):
        Model = member("illumcli.models", tag)
        lobes = Model(**({"file": measured[tag]} if tag in measured else {})).lobes()
        whole = best(lambda lobes=lobes: terms.evaluate(lobes, given))
        apart = {
            name: best(lambda one={name: lobe}: terms.evaluate(one, given)) for name, lobe in lobes.items()
        }
        print(f"{tag:28s} {whole:8.1f} ns   " + "   ".join(f"{name} {ns:.1f}" for name, ns in apart.items()))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        main(measurements(folder))
