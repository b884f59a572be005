"""Relations of shadows on coarse smooth meshes."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metamorphic import scenes, surfaces
from metamorphic.pictures import Studio
from metamorphic.premises import at_centres, from_polygons
from metamorphic.relation import relation
from metamorphic.scenes import RATES, Case


def near(case: Case, random: Random) -> tuple[Case, dict[str, Any]]:
    """The case with one coarse smooth receiver, lit and seen at one of its faces, and an object that stands
    within a face's diameter of it, on the light's way or on the face itself."""
    case = at_centres(case)
    surface = random.choice([surfaces.ball, surfaces.slab, surfaces.hills])(random)
    if random.random() < 0.5:
        surface = surface.triangles()
    case.meshes["receiver.obj"] = surface
    corners = surface.vertices[list(random.choice(surface.faces))]
    centre = corners.mean(axis=0)
    n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    n /= np.linalg.norm(n)
    size = float(np.linalg.norm(corners[:, None] - corners, axis=2).max())
    way = turned_by(n, random, 70)
    around = random.choice(
        [
            {"position": (centre + way * 5).tolist(), "light": "point"},
            {"direction": (-way).tolist(), "light": "directional"},
        ]
    )
    eye = turned_by(n, random, 50)
    case.scene["cameras"] = {
        "c0": {
            "projection": "orthographic", "extent": 1.2 * size, "target": centre.tolist(),
            "position": (centre + 4 * eye).tolist(), "up": turned_by(n, random, 80).tolist(),
        }
    }  # fmt: skip
    case.scene["lights"] = [{**around, "name": "l0"}]
    if random.random() < 0.5:
        place, radius = centre + n * size * 0.1, size * 0.1
        mesh: dict[str, Any] = {"shape": "sphere", "radius": radius, "segments": 12, "rings": 6}
    else:
        place = centre + way * size * random.uniform(0.1, 0.9)
        side = np.cross(way, n + np.array([0.01, 0.02, 0.03]))
        side *= size * random.uniform(0.1, 0.3) / np.linalg.norm(side)
        up = np.cross(way, side)
        corners = [side + up, side - up, -side - up, -side + up]
        mesh = {"shape": "polygons", "vertices": [c.tolist() for c in corners], "faces": [[0, 1, 2, 3]]}
    case.scene["objects"] = [
        {"mesh": "receiver.obj", "name": "receiver", "shading": random.choice(RATES[1:])}
    ]
    return case, {"mesh": mesh, "name": "occluder", "transform": {"translate": place.tolist()}}


def turned_by(n: NDArray[np.float64], random: Random, most: float) -> NDArray[np.float64]:
    """A unit vector at most so many degrees from `n`."""
    while True:
        way = np.array(scenes.direction(random, -1))
        if way @ n > math.cos(math.radians(most)) * np.linalg.norm(way):
            return way / np.linalg.norm(way)


@relation("exact")
def what_stands_near_shadows_smooth_meshes(case: Case, random: Random, studio: Studio) -> None:
    """Places that another object nearby shadows when shadows begin on polygons are in its shadow too when
    they begin on the smooth surface. Premise: one sample per pixel."""
    case, occluder = near(case, random)
    layers = ("shadow.l0", "object_id")
    lone = studio(from_polygons(case), layers)
    case.scene["objects"].append(occluder)
    flat, smooth = studio(from_polygons(case), layers), studio(case, layers)
    here = smooth["c0", "object_id"] == 1
    cast = here & (lone["c0", "shadow.l0"] == 1) & (flat["c0", "shadow.l0"] == 0)
    lost = int((cast & (smooth["c0", "shadow.l0"] > 0)).sum())
    assert lost == 0, f"{lost} of {int(cast.sum())} pixels in the shadow of an object nearby are lit"
