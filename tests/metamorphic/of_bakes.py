"""Relations of baked obscurance: with pictures, and among copies of a vertex."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.files.vertex_data import read_npz
from illumcli.geometry.assemble import transform_matrix
from illumcli.geometry.readers import read_mesh
from illumcli.jobs import ao_bake
from illumcli.scene.load import load
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
    Premises: independent rays, normals of the file, one per vertex; errors as the bake states them and as
    independent rays have them."""
    case = at_centres(case)
    surface = random.choice([surfaces.ball, surfaces.slab, surfaces.hills])(random)
    surface = Surface(surface.vertices, surface.faces, surface.normals)
    case.meshes.clear()
    case.meshes["receiver.obj"] = surface
    thing = {"mesh": "receiver.obj", "name": "receiver", "transform": scenes.transform(random)}
    thing["shading"] = random.choice(RATES[1:])
    other = {"mesh": scenes.shape(random), "name": "other", "transform": scenes.transform(random)}
    settings = scenes.obscurance(random) | {"sampler": "random", "samples": PIXEL_RAYS, "about": "shading"}
    case.scene |= {
        "objects": [thing, other],
        "ambient": 1,
        "obscurance": settings,
        "materials": {},
        "meshes": {},
    }
    path = case.write(studio.folder())
    asked = ao_bake.Settings(
        samples=BAKED_RAYS, falloff=settings["falloff"], sampler="random", faces=settings["faces"]
    )
    ao_bake.run(path, [path.with_suffix(".npz")], asked, threads=1)
    baked = read_npz(path.with_suffix(".npz"))
    w, error = baked.obscurance, baked.standard_error
    mesh = read_mesh(path.with_name("receiver.obj"))
    matrix = transform_matrix(load(path).scene.objects[0].transform, mesh)
    side = 1 if np.linalg.det(matrix[:3, :3]) > 0 else -1
    places = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    views, what = {}, []
    for vertex in random.sample(range(len(places)), 4):
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
    path = case.write(studio.folder())
    ao_bake.run(path, [path.with_suffix(".npz")], ao_bake.Settings(samples=512, sampler="random"), threads=1)
    w = read_npz(path.with_suffix(".npz")).obscurance[: len(surface.vertices)].astype(np.float64)
    for place in np.unique(surface.vertices, axis=0):
        own = w[(surface.vertices == place).all(axis=1)]
        spread = math.sqrt(2 * max(own.mean() * (1 - own.mean()), 2 / 512) / 512)
        z = float(np.ptp(own)) / spread
        assert z < 6, (
            f"copies of the vertex at {place.tolist()} have w from {own.min():.4f} to {own.max():.4f}"
        )
