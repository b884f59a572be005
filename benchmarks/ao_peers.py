"""Which baker of ambient occlusion is nearest to the truth after so many seconds?

Question   Seconds and error of a mesh's vertices at a few numbers of rays, and from these the seconds that
           each takes to the error we have at EQUAL rays.
Others     Open3D (a script over RaycastingScene with independent cosine-weighted rays) computes our quantity:
           the whole hemisphere, weighed by the cosine, no cut-off. PyMeshLab's CPU filter does too, but at
           the middles of faces, averaged to vertices, and without dividing by what an open point sees.
           libigl counts rays that are spread evenly over the hemisphere, without the cosine. Both are
           judged by what they tend to: libigl by REFERENCE even directions, PyMeshLab by itself at FINEST.
Reference  REFERENCE rays at VERTICES vertices.
Repeats    Every run once per round, the least of ROUNDS; counts from SLOW rays on in the first round alone.
           Each run builds its tree anew and ends with values at all vertices; ours with their errors, too.
           The seconds at equal error follow each curve's own line in log-log.
           Needs `pip install libigl pymeshlab open3d` in an environment of its own; Open3D the system's
           libusb-1.0-0 and libgl1.

    python benchmarks/ao_peers.py MESH
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np

from _bench import SMALL, Took, header, took
from ao_error import caster
from illumcli.arrays import F
from illumcli.baking.at_vertices import sampled_at_vertices
from illumcli.baking.context import BakeContext, StageClock
from illumcli.baking.loading import mesh_alone, surfaces_of
from illumcli.baking.measures import measures
from illumcli.baking.occluders import occluders_of
from illumcli.baking.sampling import BakeSampler, RayCounts
from illumcli.baking.settings import BakeSettings
from illumcli.files.journal import Journal
from illumcli.progress import no_progress
from illumcli.rays.sampling import GOLDEN
from illumcli.visibility.hemisphere import PACKET, turned_frame

COUNTS = (16, 64) if SMALL else (16, 64, 256, 1024)
EQUAL = 64 if SMALL else 256
REFERENCE = 4096
FINEST = 4096
VERTICES = 100 if SMALL else 4000  # among 400, the few that are far off decide
ROUNDS, SLOW = 3, 1024
THREADS = len(os.sched_getaffinity(0))


@dataclass(slots=True)
class Baker:
    """A program: its values at all points with so many rays, and what they tend to at some."""

    name: str
    bake: Callable[[int], np.ndarray]
    limit: np.ndarray
    best: dict[int, Took] = field(default_factory=dict)
    rmse: dict[int, float] = field(default_factory=dict)
    off: dict[int, float] = field(default_factory=dict)


def main() -> None:
    path = Path(next(word for word in sys.argv[1:] if not word.startswith("-")))
    own, lanes = caster(path)
    few = np.sort(np.random.default_rng(0).permutation(lanes)[:VERTICES])
    counts = RayCounts(few, np.full(len(few), REFERENCE))
    truth = own.estimate("reference", counts, 1 << 30).values.w.astype(float)
    header("Which baker is nearest to the truth after so many seconds?", mesh=path.name, rounds=ROUNDS)
    bakers = [illum(path, truth), illum(path, truth, True), *peers(path, own, few, truth)]
    for number in range(ROUNDS):
        for count in COUNTS:
            for each in bakers if number == 0 or count < SLOW else ():
                measure(each, count, few, truth)
    print(f"{'':14s} {'rays':>6s} {'wall [s]':>9s} {'cpu [s]':>9s} {'RMSE':>9s} {'RMSE to w':>10s}")
    for each in bakers:
        for count in COUNTS:
            times = each.best[count]
            errors = f"{each.rmse[count]:9.5f} {each.off[count]:10.5f}"
            print(f"{each.name:14s} {count:6d} {times.wall:9.3f} {times.cpu:9.3f} {errors}")
    aim = bakers[0].rmse[EQUAL]
    print(f"to our RMSE at {EQUAL} rays, {aim:.5f}:")
    for each in bakers:
        rays, wall, cpu = (at_error(each, aim, what) for what in ("rays", "wall", "cpu"))
        base = bakers[0].best[EQUAL]
        print(
            f"  {each.name:14s} {rays:8.0f} rays, wall {wall:8.2f} s, {wall / base.wall:6.2f} times ours;"
            f" cpu {cpu:8.2f} s, {cpu / base.cpu:6.2f} times ours"
        )


def measure(each: Baker, count: int, few: np.ndarray, truth: np.ndarray) -> None:
    """Run once; keep the least seconds and the error."""
    made: list[np.ndarray] = []
    now = took(lambda: made.append(each.bake(count)))
    before = each.best.get(count, now)
    each.best[count] = Took(min(now.wall, before.wall), min(now.cpu, before.cpu))
    if count not in each.rmse:
        each.rmse[count] = float(np.sqrt(np.mean((made[0][few] - each.limit) ** 2)))
        each.off[count] = float(np.sqrt(np.mean((made[0][few] - truth) ** 2)))


def at_error(each: Baker, aim: float, what: str) -> float:
    """Rays or seconds at which a baker's line through its two nearest counts has the error."""
    count = np.array(COUNTS)
    rmse = np.log([each.rmse[n] for n in COUNTS])
    values = count if what == "rays" else [getattr(each.best[n], what) for n in COUNTS]
    k = int(np.clip(np.searchsorted(-rmse, -np.log(aim)), 1, len(count) - 1))
    share = (np.log(aim) - rmse[k - 1]) / (rmse[k] - rmse[k - 1])
    low, high = np.log(values[k - 1]), np.log(values[k])
    return float(np.exp(low + share * (high - low)))


def illum(path: Path, truth: np.ndarray, is_reconstructed: bool = False) -> Baker:
    """This program: all that `illum ao-bake`, with `--reconstruct` or without, does between reading and
    writing."""
    loaded = mesh_alone(path)
    surfaces, _ = surfaces_of(loaded.scene, loaded)
    geometry = surfaces.geometry

    def bake(rays: int) -> np.ndarray:
        settings = BakeSettings(samples=rays, reconstruct=is_reconstructed)
        wanted = measures(settings, geometry.render_space.radius)
        occluders = occluders_of(loaded.scene.object_names(), geometry, settings, {})
        journal = Journal(Path(os.devnull) / "none", "00")  # keeps nothing
        values = sampled_at_vertices(
            BakeContext(surfaces, occluders, wanted, settings, THREADS, no_progress, StageClock(), journal)
        )
        return values.of_points.channels["obscurance"]

    return Baker("illum, fitted" if is_reconstructed else "illum", bake, truth)


def peers(path: Path, own: BakeSampler, few: np.ndarray, truth: np.ndarray) -> list[Baker]:
    """Those that are installed."""
    loaded = mesh_alone(path)
    geometry = surfaces_of(loaded.scene, loaded)[0].geometry
    vertices, faces = np.ascontiguousarray(geometry.vertices), np.ascontiguousarray(geometry.triangles)
    origins, n = np.ascontiguousarray(starts(own)), np.ascontiguousarray(own.points.n)
    found = []
    for name, make in {
        "Open3D": lambda: Baker("Open3D", open3d_script(vertices, faces, origins, n), truth),
        "PyMeshLab": lambda: pymeshlab_filter(vertices, faces, own.points.key, few),
        "libigl": lambda: Baker("libigl", libigl(vertices, faces, origins, n), even(own, few)),
    }.items():
        try:
            found.append(make())
            print(f"# {name} {version(name.lower())}")
        except ImportError as why:
            print(f"# no {name}: {why}")
    return found


def starts(own: BakeSampler) -> np.ndarray:
    """(M, 3) one of the places around each point from which rays start."""
    out = np.empty_like(own.points.position)
    for is_flat in (False, True):
        some = np.flatnonzero(own.points.is_flat == is_flat)
        if some.size:
            over = own.points.hemispheres(some, np.zeros(len(some)), PACKET, own.measure.method.sampler)
            out[some] = over.origins[:: over.origins_per_point]
    return out


def even(own: BakeSampler, few: np.ndarray) -> np.ndarray:
    """What libigl tends to: the share of the hemisphere, without the cosine, that is open."""
    k = np.arange(REFERENCE)
    z = (k + 0.5) / REFERENCE
    angle = 2 * np.pi * ((k * GOLDEN) % 1)
    r = np.sqrt(1 - z * z)
    pattern = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1).astype(F)
    turns = np.random.default_rng(2).random(len(few)) * 2 * np.pi
    out, origins = np.empty(len(few)), starts(own)
    for number, (lane, turn) in enumerate(zip(few, turns, strict=True)):
        d = pattern @ turned_frame(own.points.n[lane : lane + 1], np.array([turn], F))[0]
        o = np.repeat(np.ascontiguousarray(origins[lane : lane + 1]), REFERENCE, axis=0)
        out[number] = 1 - own.occluders[0].tracer.occluded(o, d).mean()
    return out


def libigl(vertices, faces, origins, n) -> Callable[[int], np.ndarray]:
    """libigl's function, 1 where open."""
    import igl.embree

    given = vertices.astype(float), faces.astype(np.int64), origins.astype(float), n.astype(float)
    return lambda rays: 1 - igl.embree.ambient_occlusion(*given, rays)


def pymeshlab_filter(vertices, faces, number, few) -> Baker:
    """MeshLab's filter, scaled so that its largest value is what a vertex sees that is open."""
    import pymeshlab

    def bake(rays: int) -> np.ndarray:
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(vertices.astype(float), faces.astype(np.int32)))
        meshes.compute_scalar_ambient_occlusion(rays=rays)
        values = meshes.current_mesh().vertex_scalar_array()[number % len(vertices)]
        return values / values.max()

    return Baker("PyMeshLab", bake, bake(FINEST)[few])


def open3d_script(vertices, faces, origins, n) -> Callable[[int], np.ndarray]:
    """A script as Open3D's users write it, in calls of some vertices."""
    import open3d

    rng = np.random.default_rng(1)

    def bake(rays: int) -> np.ndarray:
        scene = open3d.t.geometry.RaycastingScene(nthreads=THREADS)
        scene.add_triangles(vertices, faces.astype(np.uint32))
        out = np.empty(len(origins))
        size = max(1, (1 << 20) // rays)
        for first in range(0, len(origins), size):
            m = n[first : first + size]
            d = rng.standard_normal(size=(len(m), rays, 3), dtype=np.float32)
            d /= np.linalg.norm(d, axis=2, keepdims=True)
            d += m[:, None]  # a unit vector plus the normal is cosine-weighted
            o = np.broadcast_to(origins[first : first + size, None], d.shape)
            hit = scene.test_occlusions(open3d.core.Tensor(np.concatenate([o, d], axis=2)))
            out[first : first + size] = 1 - hit.numpy().mean(axis=1)
        return out

    return bake


if __name__ == "__main__":
    main()
