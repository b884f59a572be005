"""From the outputs asked for to the ordered steps that make them: data that prints itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from illumcli.demand import Recipe, order
from illumcli.errors import LimitError
from illumcli.film.film import Layer
from illumcli.plan.recipes import View, active_lights, is_ambient, is_emissive, layers, recipes, views
from illumcli.scene.spec import Scene

GIVEN = ("view", "tile")
LARGEST_SIDE = 1 << 16
MOST_RAYS = 10**11


@dataclass(frozen=True, slots=True)
class Plan:
    """What will run for a scene, in order, and what will not."""

    views: tuple[View, ...]
    layers: tuple[Layer, ...]
    once: tuple[Recipe, ...]
    tile: tuple[Recipe, ...]
    skipped: Mapping[str, str]
    """Buffer -> why it is not computed."""
    expected_rays: Mapping[str, int]
    """Upper bounds by purpose, all views together."""

    def last_use(self) -> dict[str, int]:
        """The last tile step that reads each buffer made in the tile; those of layers are kept."""
        kept = {layer.buffer for layer in self.layers} | {"hits", "samples", "alpha"}
        made = {step.makes for step in self.tile}
        last: dict[str, int] = {}
        for number, step in enumerate(self.tile):
            for name in step.needs.values():
                if name in made and name not in kept:
                    last[name] = number
        return last

    def as_data(self) -> dict[str, Any]:
        """The plan as JSON has it."""
        return {
            "views": [
                {"camera": v.name, "width": v.width, "height": v.height, "samples": v.samples}
                for v in self.views
            ],
            "layers": [layer.name for layer in self.layers],
            "once": [step.makes for step in self.once],
            "tile": [step.makes for step in self.tile],
            "skipped": dict(self.skipped),
            "expected_rays": dict(self.expected_rays),
        }


def plan(scene: Scene, loaded: Any, only: Sequence[str] = ()) -> Plan:
    """The plan for a scene's outputs, or for `only` some layers. Reads no mesh, traces nothing.

    Raises
    ------
    LimitError
        A film larger or more rays than this program takes on.
    """
    book = recipes(scene, loaded)
    wanted = layers(scene, only or scene.outputs.layers)
    coverage = ["alpha"] if any(layer.buffer == "beauty" for layer in wanted) else []
    outputs = [*dict.fromkeys(layer.buffer for layer in wanted), *coverage, "hits", "samples"]
    steps = order(book, outputs, GIVEN)
    in_tile = set(GIVEN)
    once, tile = [], []
    for step in steps:
        if in_tile & set(step.needs.values()):
            in_tile.add(step.makes)
            tile.append(step)
        else:
            once.append(step)
    all_views = tuple(views(scene))
    rays = _expected_rays(scene, all_views, {step.makes for step in steps})
    _refuse(all_views, rays)
    made = {step.makes for step in steps}
    return Plan(all_views, tuple(wanted), tuple(once), tuple(tile), _why_not(scene, book, made), rays)


def _expected_rays(scene: Scene, all_views: Sequence[View], made: set[str]) -> dict[str, int]:
    samples = sum(view.width * view.height * view.samples for view in all_views)
    rays = {"primary": samples}
    for name, light in scene.named_lights().items():
        if f"shadow:{name}" in made and light.shadows and any(light.color()):
            rays[f"shadow:{name}"] = samples
    if "obscurance" in made and scene.obscurance:
        rays["obscurance"] = samples * scene.obscurance.samples
    return rays


def _refuse(all_views: Sequence[View], rays: Mapping[str, int]) -> None:
    for view in all_views:
        if max(view.width, view.height) > LARGEST_SIDE:
            raise LimitError(
                f"camera {view.name}: a film of {view.width} x {view.height} pixels is beyond the limit of "
                f"{LARGEST_SIDE} a side; render parts with a narrower camera"
            )
    if sum(rays.values()) > MOST_RAYS:
        raise LimitError(
            f"{sum(rays.values()):.2g} rays are beyond the limit of {MOST_RAYS:.0e}; lower film.samples, "
            "obscurance.samples or the film's size"
        )


def _why_not(scene: Scene, book: Mapping[str, Recipe], made: set[str]) -> dict[str, str]:
    """A reason for every buffer that is not computed."""
    reasons = {}
    active = active_lights(scene)
    for name in book:
        if name in made:
            continue
        kind, _, light = name.partition(":")
        if light and light not in active:
            reasons[name] = "the light's intensity is 0"
        elif kind in ("shadow", "reach") and light and not active[light].shadows:
            reasons[name] = "the light casts no shadows"
        elif kind in ("obscurance", "obscurance_origins") and scene.obscurance is None:
            reasons[name] = "the scene has no obscurance: w = 1"
        elif kind in ("ambient", "ambient_color", "obscurance", "obscurance_origins") and not is_ambient(
            scene
        ):
            reasons[name] = "no ambient light leaves any surface"
        elif kind == "emission" and not is_emissive(scene):
            reasons[name] = "no material emits"
        else:
            reasons[name] = "no layer asked for reaches it"
    return reasons
