"""Relations of objects: none is affected by another that cannot occlude it."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metamorphic import scenes
from metamorphic.pictures import ALL, Pictures, Studio, close, light_layers, same
from metamorphic.premises import (
    SEEN,
    UNDRAWN,
    at_centres,
    fixed_samples,
    framed,
    plain_material,
    with_own_meshes,
    within_reach,
    without_rays,
)
from metamorphic.relation import relation
from metamorphic.scenes import RATES, Case


def stranger(random: Random, case: Case) -> dict[str, Any]:
    """An object below all others, out of the way of their light and the reach of their obscurance rays."""
    mesh = scenes.shape(random)
    place = [scenes.number(random, -5, 5), scenes.number(random, -7, -6), scenes.number(random, -5, 5)]
    turn = [scenes.number(random, -180, 180) for _ in range(3)]
    return {
        "name": "stranger",
        "mesh": mesh,
        "material": scenes.material(random),
        "shading": random.choice(RATES),
        "transform": {"fit": 1.2, "rotate": turn, "translate": place},
    }


@relation("rounding")
def an_object_out_of_reach_tells_nothing(case: Case, random: Random, studio: Studio) -> None:
    """What stands below all others, beyond their obscurance rays and every light's way, changes only the
    pixels that see it. Premises: fixed samples, lights from above, occluders count within 1.5; two specks
    hold the scene's frame, so that hits alone round anew, at edges."""
    case = within_reach(framed(fixed_samples(case)), 1.5)
    beside, lone = case.copy(), case.copy()
    own = stranger(random, case)
    beside.scene["objects"].append(own)
    lone.scene["objects"] = [case.scene["objects"][-1], own]
    cover = studio(lone, ("alpha",))
    free = {view: values[..., 0] == 0 for (view, _), values in cover.items()}
    layers = (*SEEN, *light_layers(case))
    close(studio(case, layers), studio(beside, layers), where=free, share=1e-5)


@relation("rounding")
def an_object_far_off_tells_nothing(case: Case, random: Random, studio: Studio) -> None:
    """The same of one 40 below, which moves the scene's centre and radius: offsets grow and the last bits
    change. Premises: fixed samples, lights from above, no obscurance, whose rays follow the last bits of
    normals."""
    case = without_rays(fixed_samples(case))
    beside = case.copy()
    own = stranger(random, case)
    own["transform"]["translate"][1] -= 34
    lone = case.copy()
    beside.scene["objects"].append(own)
    lone.scene["objects"] = [own]
    free = {view: values[..., 0] == 0 for (view, _), values in studio(lone, ("alpha",)).items()}
    close(studio(case, UNDRAWN), studio(beside, UNDRAWN), where=free, share=1e-3)


@relation("rounding")
def the_order_of_objects_is_free(case: Case, random: Random, studio: Studio) -> None:
    """Objects in another order are the same picture, their numbers apart. Premise: fixed samples. Hits on
    edges that triangles share may round anew."""
    case = fixed_samples(case)
    turned = case.copy()
    order = list(range(len(case.scene["objects"])))
    random.shuffle(order)
    turned.scene["objects"] = [case.scene["objects"][k] for k in order]
    layers = tuple(name for name in (*SEEN, *light_layers(case)) if name != "material_id")
    a, b = studio(case, layers), studio(turned, layers)
    number = np.array([0, *(k + 1 for k in order)], np.float32)
    for key in b:
        if key[1] == "object_id":
            b[key] = number[b[key].astype(int)]
    close(a, b, share=1e-5)


@relation("rounding")
def a_shared_mesh_is_a_mesh_each(case: Case, random: Random, studio: Studio) -> None:
    """Objects that share a mesh look as those that have one each, from another file, but for rounding: Embree
    hits them in a space of their own. Premises: one sample per pixel, no obscurance, whose rays follow the
    last bits of normals."""
    case = without_rays(at_centres(case))
    apart = with_own_meshes(case)
    layers = (*UNDRAWN, "triangle_id", *light_layers(case))
    close(studio(case, layers), studio(apart, layers), share=1e-3, outliers=3)


@relation("exact")
def a_material_is_its_objects_own(case: Case, random: Random, studio: Studio) -> None:
    """Another material of one object changes no pixel of others. Premise: one sample per pixel."""
    case = at_centres(case)
    other = case.copy()
    number = random.randrange(len(case.scene["objects"]))
    plain_material(random, other.scene["objects"][number])
    layers = tuple(name for name in (*ALL, *light_layers(case)) if name != "material_id")
    a, b = studio(case, layers), studio(other, layers)
    same(a, b, where=elsewhere(a, number))


@relation("rounding")
def a_rate_is_its_objects_own(case: Case, random: Random, studio: Studio) -> None:
    """Another rate of one object changes no pixel of others by more than rounding: where any object has
    values at its vertices, normals of flat polygons are interpolated as those are. Premises: one sample per
    pixel, no obscurance, whose rays follow the last bits of normals."""
    case = without_rays(at_centres(case))
    other = case.copy()
    number = random.randrange(len(case.scene["objects"]))
    other.scene["objects"][number]["shading"] = random.choice(RATES)
    layers = (*UNDRAWN, *light_layers(case))
    a, b = studio(case, layers), studio(other, layers)
    close(a, b, where=elsewhere(a, number), share=1e-5, outliers=0)


def elsewhere(made: Pictures, number: int) -> dict[str, NDArray[np.bool_]]:
    """Per camera, the pixels that do not see the object of this number."""
    return {
        view: values[..., 0] != number + 1 for (view, layer), values in made.items() if layer == "object_id"
    }


@relation("exact")
def names_mean_nothing(case: Case, random: Random, studio: Studio) -> None:
    """Materials and meshes by other names, in another order, are the same picture."""
    renamed = case.copy()
    scene = renamed.scene
    for part, key in (("meshes", "mesh"), ("materials", "material")):
        names = list(scene[part])
        random.shuffle(names)
        new = {name: f"{part}-{k}" for k, name in enumerate(names)}
        scene[part] = {new[name]: scene[part][name] for name in names}
        for thing in scene["objects"]:
            if isinstance(thing.get(key), str):
                thing[key] = new[thing[key]]
    layers = (*ALL, "triangle_id", *light_layers(case))
    same(studio(case, layers), studio(renamed, layers))


@relation("exact")
def an_occluder_never_brightens(case: Case, random: Random, studio: Studio) -> None:
    """One more object hides more: where it is not seen itself, neither w nor a light's way grows.
    Premises: fixed samples, a framed scene, faces that count alike, shadow rays from the same places."""
    case = framed(fixed_samples(case))
    if "obscurance" in case.scene:
        case.scene["obscurance"]["faces"] = "count"
    more, lone = case.copy(), case.copy()
    own = {"name": "more", "mesh": scenes.shape(random), "transform": scenes.transform(random)}
    more.scene["objects"].append(own)
    lone.scene["objects"] = [case.scene["objects"][-1], own]
    layers = ("obscurance", *(f"shadow.{name}" for name in light_layers(case)))
    a, b, cover = studio(case, layers), studio(more, layers), studio(lone, ("alpha",))
    for key, values in a.items():
        grown = ((b[key] > values + 1e-6) & (cover[key[0], "alpha"] == 0)).sum()
        assert grown <= 2, f"{key}: {grown} pixels of {values.size} are less hidden"
