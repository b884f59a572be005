"""Relations of baked obscurance: with pictures, and among copies of a vertex."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.baking.bake import bake_mesh
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.geometry.transforms import transform_matrix
from illumcli.mesh_files import read_mesh
from illumcli.scene.load import load
from illumcli.visibility.baked import read_npz
from metamorphic import scenes, surfaces
from metamorphic.pictures import Studio
from metamorphic.premises import at_centres
from metamorphic.relation import relation
from metamorphic.scenes import RATES, Case
from metamorphic.surfaces import Surface

BAKED_RAYS, PIXEL_RAYS = 1024, 1024


@relation("statistical")
def pixels_at_vertices_are_bakes(case: Case, random: Random, studio: Studio) -> None:
    """w of a vertex is what pixels show just inside the polygons around it, weighed by their angles there.
    Premises: independent rays, normals of the file, one per vertex; no other object within 0.02 of the
    vertex, since bakes begin 1/256 of an edge inside; errors as the bake states them and as independent rays
    have them."""
    case = at_centres(case)
    surface = random.choice([surfaces.ball, surfaces.slab, surfaces.hills])(random)
    surface = Surface(surface.vertices, surface.faces, surface.normals)
    case.meshes.clear()
    case.meshes["receiver.obj"] = surface
    thing = {"mesh": "receiver.obj", "name": "receiver", "transform": scenes.transform(random)}
    thing["shading"] = random.choice(RATES[1:])
    x, y, z = thing["transform"]["translate"]
    level = y - random.uniform(0.3, 0.8)
    other = {"mesh": {"shape": "plane", "size": [9, 9]}, "name": "other"}
    other["transform"] = {"translate": [x, level, z]}
    settings = scenes.obscurance(random) | {"sampler": "random", "samples": PIXEL_RAYS, "about": "shading"}
    case.scene |= {
        "objects": [thing, other],
        "ambient": 1,
        "obscurance": settings,
        "materials": {},
        "meshes": {},
    }
    path = case.write(studio.folder())
    asked = BakeSettings(
        samples=BAKED_RAYS, falloff=settings["falloff"], sampler="random", faces=settings["faces"]
    )
    w, error = baked(case, studio, asked)
    mesh = read_mesh(path.with_name("receiver.obj"))
    matrix = transform_matrix(load(path).scene.objects[0].transform, mesh)
    side = 1 if np.linalg.det(matrix[:3, :3]) > 0 else -1
    places = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    views, what = {}, []
    for vertex in random.sample(range(len(places)), 8):
        for polygon in np.unique(
            np.searchsorted(mesh.starts, np.flatnonzero(mesh.corners == vertex), "right") - 1
        ):
            ring = mesh.corners[mesh.starts[polygon] : mesh.starts[polygon + 1]]
            k = int(np.flatnonzero(ring == vertex)[0])
            view, angle = just_inside(places[ring], k, side)
            views[f"v{len(what)}"] = view
            what.append((vertex, angle))
    case.scene["cameras"] = views
    made = studio(case, ("obscurance", "position", "object_id"))
    for vertex in dict.fromkeys(vertex for vertex, _ in what):
        if abs(places[vertex][1] - level) < 0.02:
            continue
        own = [(f"v{k}", angle) for k, (at, angle) in enumerate(what) if at == vertex]
        if any(made[view, "object_id"].item() != 1 for view, _ in own):
            continue  # something stands before it
        shares = np.array([angle for _, angle in own]) / sum(angle for _, angle in own)
        seen = np.array([made[view, "obscurance"].item() for view, _ in own], np.float64)
        noise = np.maximum(seen * (1 - seen), 1 / PIXEL_RAYS) / PIXEL_RAYS
        spread = math.sqrt(float((shares**2 * noise).sum()) + max(float(error[vertex]), 1 / BAKED_RAYS) ** 2)
        z = (float(shares @ seen) - float(w[vertex])) / spread
        assert abs(z) < 5.5, (
            f"vertex {vertex} at {places[vertex].tolist()}: w {w[vertex]:.4f} baked, {shares @ seen:.4f} in "
            f"pixels {seen.round(4).tolist()}, {z:.1f} standard errors apart"
        )


def just_inside(ring: NDArray[np.float64], k: int, side: int) -> tuple[dict[str, Any], float]:
    """A view of one pixel just inside corner `k` of a polygon, and the polygon's angle there."""
    here, after, before = ring[k], ring[(k + 1) % len(ring)], ring[k - 1]
    a, b = after - here, before - here
    edge = float(min(np.linalg.norm(a), np.linalg.norm(b)))
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    n = np.cross(a, b) * side
    n /= np.linalg.norm(n)
    place = here + 1e-4 * edge * (a + b)
    view = {
        "projection": "orthographic", "extent": 1e-6 * edge, "width": 1, "height": 1,
        "target": place.tolist(), "position": (place + 1e-3 * edge * n).tolist(),
    }  # fmt: skip
    return view, math.acos(np.clip(a @ b, -1, 1))


@relation("statistical")
def copies_of_a_vertex_bake_alike(case: Case, random: Random, studio: Studio) -> None:
    """Vertices that differ by their uv alone, as at poles and seams, have the same w within their errors.
    Premise: independent rays."""
    case = case.copy()
    surface = surfaces.globe(random)
    case.meshes.clear()
    case.meshes["globe.ply"] = surface
    other = {"mesh": {"shape": "plane", "size": [3, 3]}, "name": "floor"}
    case.scene |= {
        "objects": [{"mesh": "globe.ply", "name": "globe", "transform": {"translate": [0, 1.2, 0]}}, other]
    }
    case.scene |= {"materials": {}, "meshes": {}}
    w = baked(case, studio, BakeSettings(samples=512, sampler="random"))[0]
    w = w[: len(surface.vertices)].astype(np.float64)
    for place in np.unique(surface.vertices, axis=0):
        own = w[(surface.vertices == place).all(axis=1)]
        spread = math.sqrt(2 * max(own.mean() * (1 - own.mean()), 2 / 512) / 512)
        z = float(np.ptp(own)) / spread
        assert z < 6, (
            f"copies of the vertex at {place.tolist()} have w from {own.min():.4f} to {own.max():.4f}"
        )


def two_objects(case: Case, random: Random, file: str) -> Case:
    """A case of one mesh of that file, still to be made, and another object."""
    case = case.copy()
    case.meshes.clear()
    thing = {"mesh": file, "name": "receiver", "transform": scenes.transform(random)}
    other = {"mesh": scenes.shape(random), "name": "other", "transform": scenes.transform(random)}
    case.scene |= {"objects": [thing, other], "materials": {}, "meshes": {}}
    return case


def baked(case: Case, studio: Studio, settings: BakeSettings, threads: int = 1) -> NDArray[np.float32]:
    """(2, V) w and its stated error at all vertices of a case."""
    path = case.write(studio.folder())
    bake_mesh(path, [path.with_suffix(".npz")], settings, BakeOptions(threads=threads))
    made = read_npz(path.with_suffix(".npz"))
    return np.stack([made.obscurance, made.standard_error])


@relation("exact")
def a_bake_knows_neither_units_nor_threads(case: Case, random: Random, studio: Studio) -> None:
    """Everything 2^k times as large, on any number of threads, bakes to the same values and errors."""
    scale = 2.0 ** random.choice([-20, -3, 1, 20])
    case = two_objects(case, random, "receiver.obj")
    case.meshes["receiver.obj"] = random.choice(surfaces.SURFACES)(random)
    larger = case.copy()
    for thing in larger.scene["objects"]:
        grow = np.diag([scale, scale, scale, 1.0])
        thing["transform"]["matrix"] = (grow @ np.array(thing["transform"].get("matrix", np.eye(4)))).tolist()
    falloff = random.choice([{"falloff": "step"}, {"falloff": "linear", "max_distance": 1.5}])
    grown = {key: value * scale if key == "max_distance" else value for key, value in falloff.items()}
    a = baked(case, studio, BakeSettings(samples=32, falloff=falloff))
    b = baked(larger, studio, BakeSettings(samples=32, falloff=grown), threads=random.randint(1, 3))
    differ = (a != b).any(axis=0)
    assert not differ.any(), (
        f"{int(differ.sum())} of {differ.size} vertices differ: {a[:, differ]} {b[:, differ]}"
    )


@relation("exact")
def every_format_bakes_the_same(case: Case, random: Random, studio: Studio) -> None:
    """The same triangles bake to the same values from every format that keeps the order of its vertices."""
    surface = random.choice(surfaces.SURFACES)(random).triangles()
    kinds, made = ("ply", "bin.ply", "gltf", "glb"), []
    base = two_objects(case, random, "")
    for kind in kinds:
        own = base.copy()
        own.meshes[f"same.{kind}"] = surface
        own.scene["objects"][0]["mesh"] = f"same.{kind}"
        made.append(baked(own, studio, BakeSettings(samples=32)))
    for kind, values in zip(kinds, made, strict=True):
        assert values.shape == made[0].shape, f"{kind}: {values.shape} against {made[0].shape}"
        differ = (values != made[0]).any(axis=0)
        assert not differ.any(), (
            f"{kind}: {int(differ.sum())} of {differ.size} vertices differ from those of PLY"
        )
