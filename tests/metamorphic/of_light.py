"""Relations of light: it adds up and scales, and kinds of lights pass into each other."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import numpy as np

from metamorphic import scenes
from metamorphic.pictures import Pictures, Studio, close, light_layers, same
from metamorphic.premises import SEEN, fixed_samples
from metamorphic.relation import relation
from metamorphic.scenes import Case


@relation("rounding")
def lights_add_up(case: Case, random: Random, studio: Studio) -> None:
    """All lights show what each shows alone, added. Premise: fixed samples. Holds for both ambient forms
    and under depth cues, which are affine in the light."""
    case = fixed_samples(case)
    lights = case.scene["lights"]
    layers = ("beauty", "diffuse", "specular")

    def under(some: list[dict[str, Any]]) -> Pictures:
        own = case.copy()
        own.scene["lights"] = some
        return studio(own, layers)

    whole, dark = under(lights), under([])
    parts = [under([light]) for light in lights]
    for key, values in whole.items():
        base = dark[key].astype(np.float64)
        terms = [part[key] - base for part in parts]
        error = np.abs(values - base - sum(terms))
        size = np.abs(base) + sum(map(np.abs, terms))
        assert (error <= 2e-6 * size + 1e-12).all(), (
            f"{key}: off by {float((error / np.maximum(size, 1e-12)).max()):.2g} of the light"
        )


@relation("exact")
def a_light_does_not_know_of_others(case: Case, random: Random, studio: Studio) -> None:
    """A light's own layer and shadow are the same beside others and alone. Premise: fixed samples."""
    case = fixed_samples(case)
    light = random.choice(case.scene["lights"])
    alone = case.copy()
    alone.scene["lights"] = [light]
    layers = (light["name"], f"shadow.{light['name']}")
    same(studio(case, layers), studio(alone, layers))


@relation("exact")
def light_scales(case: Case, random: Random, studio: Studio) -> None:
    """Four times the light, of lamps and surroundings, is four times the picture. Premises: fixed samples,
    no emission, no depth cue into a colour, no background."""
    case = fixed_samples(case)
    case.scene.pop("depth_cue", None)
    brighter = case.copy()
    for light in brighter.scene["lights"]:
        power = "irradiance" if light["light"] == "directional" else "intensity"
        light[power] = (np.array(light[power]) * 4).tolist()
    if "ambient" in brighter.scene:
        brighter.scene["ambient"]["color"] = (np.array(brighter.scene["ambient"]["color"]) * 4).tolist()
    layers = ("ambient", "diffuse", "specular", *light_layers(case))
    once = studio(case, layers)
    a = {key: values * 4 for key, values in once.items()}
    b = studio(brighter, layers)
    same(without_faint(a), without_faint(b))


def without_faint(made: Pictures) -> Pictures:
    """0 for numbers so small that single precision holds fewer digits of them."""
    return {key: np.where(np.abs(values) < 1e-35, np.float32(0), values) for key, values in made.items()}


@relation("rounding")
def layers_add_up(case: Case, random: Random, studio: Studio) -> None:
    """Emission, ambient and the lights are the beauty; the lobes are the lights. Premises: fixed samples,
    separate ambient form, no depth cue."""
    case = fixed_samples(case)
    case.scene.pop("depth_cue", None)
    if "ambient" in case.scene:
        case.scene["ambient"]["form"] = "separate"
    lights = light_layers(case)
    made = studio(case, ("beauty", "emission", "ambient", "diffuse", "specular", *lights))
    for view in case.scene["cameras"]:
        of_lights = sum(made[view, name].astype(np.float64) for name in lights)
        whole = of_lights + made[view, "emission"] + made[view, "ambient"]
        lobes = made[view, "diffuse"].astype(np.float64) + made[view, "specular"]
        for what, a, b in (("beauty", whole, made[view, "beauty"]), ("lobes", of_lights, lobes)):
            error = float(np.abs(a - b).max(initial=0))
            assert error <= 2e-6 * float(np.abs(a).max(initial=0)) + 1e-12, (
                f"{what} of {view}: off by {error}"
            )


@relation("exact")
def a_dark_light_is_none(case: Case, random: Random, studio: Studio) -> None:
    """A light of no strength changes no pixel."""
    dark = scenes.light(random) | {"name": "dark"}
    dark["irradiance" if dark["light"] == "directional" else "intensity"] = 0
    with_it = case.copy()
    with_it.scene["lights"].insert(random.randint(0, len(case.scene["lights"])), dark)
    layers = ("beauty", "diffuse", "specular", *light_layers(case))
    same(studio(case, layers), studio(with_it, layers))


@relation("rounding")
def a_wide_spot_is_a_point(case: Case, random: Random, studio: Studio) -> None:
    """A spot whose full cone holds the whole scene is a point light, however narrow the cone and far the
    light; one that looks past the scene is dark. Premise: no depth cue into a colour."""
    case = case.copy()
    case.scene.pop("depth_cue", None)
    distance = 10 ** random.uniform(0.9, 5)
    place = np.array(scenes.direction(random, 0.3)) * distance
    point = {"light": "point", "name": "l0", "position": place.tolist(), "attenuation": {"law": "none"}}
    half = math.degrees(math.atan(6 / (distance - 6))) if distance > 12 else 80.0
    softness = random.choice([0.0, 0.5])
    cone = min(half / (1 - softness), 180.0)
    spot = point | {"light": "spot", "target": [0, 0, 0], "angle": cone, "softness": softness}
    aside = np.cross(place, scenes.direction(random, -1))
    aside *= distance * math.tan(math.radians(min(2.2 * cone, 85))) / np.linalg.norm(aside)
    layers = ("l0", "shadow.l0")

    def under(light: dict[str, Any]) -> Pictures:
        own = case.copy()
        own.scene["lights"] = [light]
        return studio(own, layers)

    close(under(point), under(spot), outliers=0)
    if distance > 30:
        past = under(spot | {"target": aside.tolist()})
        lit = max(
            float(np.abs(values).max(initial=0)) for (_, layer), values in past.items() if layer == "l0"
        )
        assert lit == 0, (
            f"a spot of {cone} degrees that looks past the scene from {distance:g} lights it: {lit}"
        )


@relation("rounding")
def a_far_light_is_directional(case: Case, random: Random, studio: Studio) -> None:
    """A point light a million away without distance law is a directional one. Premise: no adaptive samples,
    whose threshold a rounding may cross."""
    case = fixed_samples(case)
    way = np.array(scenes.direction(random, 0.3))
    far = {"light": "point", "name": "l0", "position": (way * 1e6).tolist(), "attenuation": {"law": "none"}}
    sun = {"light": "directional", "name": "l0", "direction": (-way).tolist()}
    a, b = case.copy(), case.copy()
    a.scene["lights"], b.scene["lights"] = [far], [sun]
    close(studio(a, SEEN), studio(b, SEEN), share=1e-3)
