"""Relations of scenes that are moved, mirrored or scaled as a whole."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metamorphic import scenes
from metamorphic.pictures import ALL, Pictures, Studio, close, light_layers, same
from metamorphic.premises import UNDRAWN, at_centres, from_polygons, grained, one_camera, without_rays
from metamorphic.relation import relation
from metamorphic.scenes import Case


def under(case: Case, matrix: NDArray[np.float64]) -> Case:
    """The whole scene, views and lights included, under a (4, 4) rigid motion or reflection."""
    case = case.copy()
    linear = matrix[:3, :3]

    def place(p: list[float]) -> list[float]:
        return (linear @ p + matrix[:3, 3]).tolist()

    for camera in case.scene["cameras"].values():
        camera["position"], camera["target"] = place(camera["position"]), place(camera["target"])
        camera["up"] = (linear @ camera["up"]).tolist()
    for light in case.scene["lights"]:
        for key in ("position", "target"):
            if key in light:
                light[key] = place(light[key])
        if "direction" in light:
            light["direction"] = (linear @ light["direction"]).tolist()
    for thing in case.scene["objects"]:
        own = thing.setdefault("transform", {})
        own["matrix"] = (matrix @ np.array(own.get("matrix", np.eye(4)))).tolist()
    return case


def undone(made: Pictures, matrix: NDArray[np.float64]) -> Pictures:
    """Pictures of the moved scene as those of the scene: flipped if it was mirrored, vectors brought back."""
    linear = matrix[:3, :3]
    out = {}
    for (view, layer), values in made.items():
        own = values[:, ::-1] if np.linalg.det(linear) < 0 else values
        if layer == "position":
            covered = own.any(axis=-1, keepdims=True)
            own = np.where(covered, (own - matrix[:3, 3]) @ linear, own).astype(np.float32)
        elif layer in ("normal", "geometric_normal"):
            own = (own @ linear).astype(np.float32)
        out[view, layer] = np.ascontiguousarray(own)
    return out


def rotation(random: Random) -> NDArray[np.float64]:
    """(3, 3) a random rotation."""
    q, r = np.linalg.qr(np.array([[random.gauss(0, 1) for _ in range(3)] for _ in range(3)]))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


@relation("rounding")
def a_mirrored_scene_is_the_picture_mirrored(case: Case, random: Random, studio: Studio) -> None:
    """A scene mirrored with its views and lights is its picture mirrored. Premises: one sample per pixel,
    a grain for every object, no obscurance, whose rays would lie otherwise."""
    case = grained(without_rays(at_centres(case)))
    axis = random.randrange(3)
    matrix = np.diag([-1.0 if k == axis else 1.0 for k in range(4)])
    layers = (*UNDRAWN, *light_layers(case))
    close(studio(case, layers), undone(studio(under(case, matrix), layers), matrix), share=1e-3)


@relation("rounding")
def a_moved_scene_is_the_same_picture(case: Case, random: Random, studio: Studio) -> None:
    """A scene turned and moved with its views and lights is the same picture. Premises: one sample per
    pixel, a grain for every object, no obscurance, shadows that begin on polygons, since smooth ones measure
    these along the axes."""
    case = from_polygons(grained(without_rays(at_centres(case))))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(random)
    matrix[:3, 3] = scenes.vector(random, 10 ** random.uniform(0, 4))
    layers = tuple(name for name in (*UNDRAWN, *light_layers(case)) if name != "position")
    close(studio(case, layers), undone(studio(under(case, matrix), layers), matrix), share=1e-3)


@relation("statistical")
def mirrored_obscurance_is_the_same(case: Case, random: Random, studio: Studio) -> None:
    """w of a mirrored scene agrees within its noise: by the sum and by the sum of squares over pixels that
    see the same place. Premises: one sample per pixel, independent rays."""
    case = one_camera(at_centres(case))
    rays = 64
    case.scene["obscurance"] = scenes.obscurance(random) | {"sampler": "random", "samples": rays}
    case.scene["ambient"] = 1
    matrix = np.diag([-1.0, 1.0, 1.0, 1.0])
    layers = ("obscurance", "position", "geometric_normal")
    a = studio(case, layers)
    b = undone(studio(under(case, matrix), layers), matrix)
    view = next(iter(case.scene["cameras"]))
    agree = np.ones(a[view, "obscurance"].shape[:2], bool)
    for layer in ("position", "geometric_normal"):
        agree &= (np.abs(a[view, layer] - b[view, layer]) < 1e-4).all(axis=-1)
    agree &= a[view, "position"].any(axis=-1)
    agreeing(a[view, "obscurance"][agree].ravel(), b[view, "obscurance"][agree].ravel(), rays)


def agreeing(a: NDArray, b: NDArray, rays: int) -> None:
    """Two estimates of w from `rays` independent rays each, at many points, agree within their noise."""
    mean = (a.astype(np.float64) + b) / 2
    # mu lies in 0..1, so that its variance is at most that of a coin; half a ray where both saw the same
    variance = 2 * np.maximum(mean * (1 - mean), 0.5 / rays) / rays
    difference = a.astype(np.float64) - b
    z = float(difference.sum() / np.sqrt(variance.sum())) if len(a) else 0.0
    assert abs(z) < 5, f"w differs by {z:.1f} standard errors in the mean over {len(a)} points"
    chi = float(np.square(difference).sum())
    bound = float(variance.sum() + 6 * np.sqrt(2 * np.square(variance).sum()) + 12 * variance.max(initial=0))
    assert chi <= bound, f"w differs by {chi / max(variance.sum(), 1e-12):.2f} variances over {len(a)} points"


@relation("exact")
def a_scene_in_other_units_is_the_same(case: Case, random: Random, studio: Studio) -> None:
    """Everything 2^k times as large is the same picture, bit for bit: lengths only scale."""
    scale = 2.0 ** random.choice([-20, -7, -1, 1, 9, 20])
    larger = case.copy()
    scene = larger.scene

    def scaled(value: Any) -> Any:
        return (np.array(value, np.float64) * scale).tolist()

    for camera in scene["cameras"].values():
        for key in ("position", "target", "extent"):
            if key in camera:
                camera[key] = scaled(camera[key])
    for light in scene["lights"]:
        for key in ("position", "target"):
            if key in light:
                light[key] = scaled(light[key])
        law = light.get("attenuation", {})
        if law.get("law") in ("inverse_square", "inverse_square_flux", "windowed"):
            light["intensity"] = (np.array(light["intensity"]) * scale**2).tolist()
        if law.get("law") == "windowed":
            law["range"] = scaled(law["range"])
        if law.get("law") == "polynomial":
            law["c2"], law["c3"] = law["c2"] / scale, law["c3"] / scale**2
    for thing in scene["objects"]:
        own = thing.setdefault("transform", {})
        grow = np.diag([scale, scale, scale, 1.0])
        own["matrix"] = (grow @ np.array(own.get("matrix", np.eye(4)))).tolist()
    falloff = scene.get("obscurance", {}).get("falloff", {})
    if isinstance(falloff.get("max_distance"), float):
        falloff["max_distance"] *= scale
    if "tau" in falloff and not falloff.get("relative"):
        falloff["tau"] /= scale
    if "depth_cue" in scene:
        scene["depth_cue"] |= {
            "near": scaled(scene["depth_cue"]["near"]),
            "far": scaled(scene["depth_cue"]["far"]),
        }
    layers = (*ALL, "triangle_id", *light_layers(case))
    grown = {
        key: values / np.float32(scale) if key[1] in ("depth", "position") else values
        for key, values in studio(larger, layers).items()
    }
    same(studio(case, layers), grown)
