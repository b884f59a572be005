"""Does a picture with baked values agree with one without?

Question   At vertices: do both differ by no more than their stated errors? Elsewhere: how far are values that
           are interpolated from the corners of polygons from estimates at the point itself?
Reference  The renderer's own w without baked values, RAYS rays at each point. At a corner the mean over
           AROUND points just inside the triangles around it, drawn evenly by angle among all corners of the
           vertex that share its shading normal; its error is from their spread. Elsewhere points are drawn
           evenly over the area; their noise is what a second seed differs by.
Repeats    POINTS corners and POINTS points, drawn by a fixed seed; the bake casts RAYS rays a vertex.

    PYTHONPATH=src python benchmarks/ao_agree.py [--small] MESH...
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from _bench import SMALL, header
from illumcli.arrays import F, column_major, cross, dot, length, take_rows, unit
from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeSettings
from illumcli.graph import topological_order
from illumcli.rays.interaction import Hits, interact
from illumcli.render_graph.build import build
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile
from illumcli.visibility.baked import read_npz

POINTS = 20 if SMALL else 2000
RAYS = 64 if SMALL else 256
AROUND = 16
INSIDE = 1e-3
MADE = ("geometry", "tracer", "corner_normals")


class Pictures:
    """Obscurance at points of a mesh's surface, computed as for the samples of a picture."""

    def __init__(self, loaded: SceneFile) -> None:
        graph = build(loaded.scene, loaded)
        given = ("hits", "interaction", "obscurance_draws", "view_method", "read_hits", "view", "tile")
        self.steps = topological_order(graph.nodes, [*MADE, "obscurance_method", "obscurance"], given)
        self.known: dict[str, Any] = {"read_hits": None}
        self.at: set[str] = {"hits", "interaction", "obscurance_draws"}
        for step in self.steps:
            if self.at & set(step.inputs.values()):
                self.at.add(step.output)
            else:
                self.known[step.output] = step.run(self.known)
        self.known["view_method"] = self.known["obscurance_method"]

    def w(self, triangle: np.ndarray, weights: np.ndarray, seed: int = 0) -> np.ndarray:
        """(M,) obscurance at points on triangles with (M, 3) barycentric weights."""
        geometry = self.known["geometry"]
        triangle, (_, u, v) = triangle.astype(np.int32), weights.T.astype(F)
        a, b, c = (
            column_major(take_rows(geometry.vertices, geometry.triangles[triangle, k]), np.float64)
            for k in range(3)
        )
        own = dict(self.known)
        own["hits"] = Hits(
            np.arange(len(triangle), dtype=np.int32), geometry.objects[triangle], triangle, u, v
        )
        own["interaction"] = interact(
            geometry, geometry.objects[triangle], triangle, u, v, unit(cross(b - a, c - a))
        )
        own["obscurance_draws"] = np.random.default_rng(seed).random((2, len(triangle)))
        for step in self.steps:
            if step.output in self.at:
                own[step.output] = step.run(own)
        return np.asarray(own["obscurance"], np.float64)


def around(pictures: Pictures, corner: np.ndarray, random: Any) -> tuple[np.ndarray, np.ndarray]:
    """(K * AROUND,) triangles and (K * AROUND, 3) weights of points close to K corners."""
    geometry, normals = pictures.known["geometry"], pictures.known["corner_normals"]
    places = [
        column_major(take_rows(geometry.vertices, geometry.triangles[:, k]), np.float64) for k in range(3)
    ]
    ahead, back = ([places[(k + s) % 3] - places[k] for k in range(3)] for s in (1, 2))
    areas = [length(cross(a, b)) for a, b in zip(ahead, back, strict=True)]
    angle = np.stack(
        [np.arctan2(areas[k], dot(ahead[k], back[k])) * (areas[k] > 0) for k in range(3)], axis=1
    )
    vertex, own = (
        geometry.triangles.ravel(),
        take_rows(normals.values, normals.index[geometry.corners.ravel()]),
    )
    by_vertex = np.argsort(vertex, kind="stable")
    begins = np.searchsorted(vertex[by_vertex], np.arange(len(geometry.vertices) + 1))
    triangles, weights = [], []
    for each in corner:
        beside = by_vertex[begins[vertex[each]] : begins[vertex[each] + 1]]
        beside = beside[np.linalg.norm(own[beside] - own[each], axis=1) < 1e-4]
        share = angle.ravel()[beside]
        chosen = random.choice(beside, AROUND, p=share / share.sum())
        t, k = np.divmod(chosen, 3)
        a = np.stack(ahead)[k, t]
        b = np.stack(back)[k, t]
        turn = random.random(AROUND) * angle[t, k]
        size = INSIDE * np.minimum(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
        # s a + r b lies at this angle from a, at this distance
        s = size * np.sin(angle[t, k] - turn) / np.sin(angle[t, k]) / np.linalg.norm(a, axis=1)
        r = size * np.sin(turn) / np.sin(angle[t, k]) / np.linalg.norm(b, axis=1)
        local = np.zeros((AROUND, 3))
        i = np.arange(AROUND)
        local[i, k], local[i, (k + 1) % 3], local[i, (k + 2) % 3] = 1 - s - r, s, r
        triangles.append(t)
        weights.append(local)
    return np.concatenate(triangles), np.concatenate(weights)


def agreement(path: Path, folder: Path) -> list[float]:
    """Share of corners whose |z| is below 1.96, rms and mean of z; rms difference elsewhere, its noise."""
    mesh = folder / path.name
    shutil.copy(path, mesh)
    baked = mesh.with_suffix(".npz")
    bake_mesh(mesh, [baked], BakeSettings(samples=RAYS))
    scene = mesh.with_suffix(".yaml")
    about = "version: 1\nobscurance: {samples: %d}\nobjects: [{name: mesh, mesh: {file: %s%s}}]\n"
    scene.write_text(about % (RAYS, mesh.name, ""))
    asked = Pictures(load(scene, ()))
    scene.write_text(about % (RAYS, mesh.name, f", obscurance: {baked.name}"))
    reads = Pictures(load(scene, ()))
    values, geometry = read_npz(baked), asked.known["geometry"]
    corners = geometry.placed[0].mesh.corners
    w = values.of_corners("mesh", corners, len(geometry.vertices))
    error = values.standard_error[corners]
    error = values.corner_channels.get("standard_error", error)

    # at corners that cast rays
    random = np.random.default_rng(0)
    few = random.permutation(np.flatnonzero(error[geometry.corners.ravel()] > 0))[:POINTS]
    found = asked.w(*around(asked, few, random)).reshape(len(few), AROUND)
    at = geometry.corners.ravel()[few]
    spread = found.std(axis=1, ddof=1) / AROUND**0.5
    z = (w[at] - found.mean(axis=1)) / np.hypot(spread, error[at])

    # all over the area
    a, b, c = (
        column_major(take_rows(geometry.vertices, geometry.triangles[:, k]), np.float64) for k in range(3)
    )
    area = length(cross(b - a, c - a))
    triangle = random.choice(len(area), POINTS, p=area / area.sum())
    weights = random.dirichlet((1, 1, 1), POINTS)
    one, two = (asked.w(triangle, weights, seed) for seed in (1, 2))
    noise = np.sqrt(np.mean(np.square(one - two)) / 2)
    off = np.sqrt(np.mean(np.square(reads.w(triangle, weights) - one)))
    return [float((np.abs(z) < 1.96).mean()), float(np.sqrt(np.mean(z * z))), float(z.mean()), off, noise]


def main() -> None:
    header("Does a picture with baked values agree with one without?", points=POINTS, rays=RAYS)
    print(f"{'mesh':24} {'within 1.96':>12} {'rms z':>7} {'mean z':>7} {'rmse elsewhere':>15} {'noise':>8}")
    with tempfile.TemporaryDirectory() as name:
        for path in (Path(word).resolve() for word in sys.argv[1:] if not word.startswith("--")):
            within, rms, mean, off, noise = agreement(path, Path(name))
            print(f"{path.name:24} {within:12.3f} {rms:7.2f} {mean:7.2f} {off:15.4f} {noise:8.4f}")


if __name__ == "__main__":
    main()
