"""From the outputs asked for to the ordered steps that make them: data that prints itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from illumcli import __version__
from illumcli.cache.fingerprint import digest
from illumcli.errors import InputError, LimitError
from illumcli.film.tiles import tile_side
from illumcli.film.view import View
from illumcli.graph import Node, topological_order
from illumcli.layers import Layer
from illumcli.records import Value
from illumcli.render_graph.build import (
    GIVEN,
    SHAPE,
    active_lights,
    is_ambient,
    is_baked,
    is_emissive,
    layers,
    recipes,
    views,
)
from illumcli.render_graph.cached import Artifacts, Book, Picture, kind_of
from illumcli.render_graph.keys import Keys, code
from illumcli.render_graph.replicates import AGAIN, BLOCK, doubled_count
from illumcli.scene.spec import Scene

LARGEST_SIDE = 1 << 16
MOST_RAYS = 10**11


class Plan(Value):
    """What will run for a scene, in order, and what will not."""

    views: tuple[View, ...]
    layers: tuple[Layer, ...]
    once: tuple[Node, ...]
    tile: tuple[Node, ...]
    skipped: Mapping[str, str]
    """Buffer -> why it is not computed."""
    expected_rays: Mapping[str, int]
    """Upper bounds by purpose, all views together."""
    reused: Mapping[str, str] = field(default_factory=dict)
    """Buffer -> where it is at hand: `memory` or `store`."""
    keeps: Mapping[str, str] = field(default_factory=dict)
    """Buffers that are made and may be kept -> the key they are kept by."""
    objects: str = ""
    """Which objects take part."""
    scene: Scene | None = field(default=None, repr=False)
    book: Mapping[str, Node] = field(default_factory=dict, repr=False)

    def last_use(self) -> dict[str, int]:
        """The last tile step that reads each buffer made in the tile; those of layers are kept."""
        # the film reads them
        kept = {layer.buffer for layer in self.layers} | {"hits", "samples", "alpha"}
        kept |= set(SHAPE) if any(view.is_adaptive for view in self.views) else set()
        made = {step.output for step in self.tile}
        last: dict[str, int] = {}
        for number, step in enumerate(self.tile):
            for name in step.inputs.values():
                if name in made and name not in kept:
                    last[name] = number
        return last

    def as_data(self) -> dict[str, Any]:
        """The plan as JSON has it."""
        return {
            "views": [
                {"camera": v.name, "width": v.width, "height": v.height, "samples": v.samples}
                | ({"first_samples": v.adaptive.first} if v.is_adaptive else {})
                for v in self.views
            ],
            "layers": [layer.name for layer in self.layers],
            "objects": self.objects,
            "once": [step.output for step in self.once],
            "tile": [step.output for step in self.tile],
            "skipped": dict(self.skipped),
            "expected_rays": dict(self.expected_rays),
            "reused": dict(self.reused),
            "expected_bytes": self.expected_bytes(),
        }

    def tile_side(self, view: View, side: int | None = None) -> int:
        """Pixels along a tile's side: `side` or the default, in whole blocks where these have one error."""
        side = side or tile_side(view.samples, view.width * view.height)
        return -(-side // BLOCK) * BLOCK if any(layer.per_pixel for layer in self.layers) else side

    def expected_bytes(self) -> dict[str, int]:
        """What the run takes beyond its meshes: a band of tiles, each artifact that is read, each that may be
        written, whose pages the system may drop. Upper bounds."""
        sizes = {}
        for view in self.views:
            lanes = min(view.height, self.tile_side(view)) * view.width * view.samples
            sizes["band"] = lanes * 4 * sum(len(layer.channels) for layer in self.layers) // view.samples
            for name in [*self.keeps, *self.reused]:
                if kind := kind_of(name):
                    shape, dtype = Picture.shape(kind, view)
                    sizes[name] = math.prod(shape) * np.dtype(dtype).itemsize
        return sizes

    def needed_for(self, name: str) -> frozenset[str]:
        """Every buffer that `name` is made from, itself included, those at hand left out."""
        needs: set[str] = set()
        open_names = [name]
        while open_names:
            each = open_names.pop()
            if each not in needs and each not in self.reused and each not in GIVEN:
                needs.add(each)
                open_names += self.book[each].inputs.values()
        return frozenset(needs)


def plan(scene: Scene, loaded: Any, only: Sequence[str] = (), unseen: tuple[int, ...] = ()) -> Plan:
    """The plan for a scene's outputs, or for `only` some layers. Reads no mesh, traces nothing.

    The objects of the numbers `unseen` are known to change no picture.

    Raises
    ------
    InputError
        Layers that do not exist, or not with this film.
    LimitError
        A film larger or more rays than this program takes on.
    """
    book = recipes(scene, loaded, unseen)
    wanted = tuple(layers(scene, only or scene.outputs.layers))
    all_views = tuple(views(scene))
    if any(layer.per_pixel for layer in wanted) and any(view.is_adaptive for view in all_views):
        raise InputError(
            "the layer error is that of a fixed number of samples; leave it out, or film.adaptive"
        )
    once, tile = _steps(book, wanted, all_views)
    made = {step.output for step in (*once, *tile)}
    rays = _expected_rays(scene, all_views, made)
    _refuse(all_views, rays)
    reasons = _why_not(scene, book, made)
    if "error" in made and f"{AGAIN}samples" not in made:
        reasons[f"{AGAIN}beauty"] = "nothing in the picture is random: its error is 0"
    return Plan(all_views, wanted, once, tile, reasons, rays, scene=scene, book=book)


def reusing(made: Plan, view: View, artifacts: Artifacts) -> Plan:
    """The plan for one view, with what is at hand loaded instead of made."""
    book = Book(made.book, view, artifacts)
    once, tile = _steps(book, made.layers, (view,))
    steps = {step.output for step in (*once, *tile)}
    found = {name: where for name, where in artifacts.reused.items() if name in steps}
    rays = _expected_rays(made.scene, (view,), steps - found.keys())
    skipped = dict(made.skipped)
    for step in (*made.once, *made.tile):
        if step.output not in steps and book.keys_of(step.output) not in artifacts.made:
            skipped[step.output] = "all that needs it is at hand"
    new = [name for name in steps - found.keys() if book.keys_of(name) not in artifacts.made]
    kept = {name: book.keys_of(name) for name in new if artifacts.keeps(name)}
    return replace(
        made,
        views=(view,),
        once=once,
        tile=tile,
        skipped=skipped,
        expected_rays=rays,
        reused=found,
        keeps=kept,
    )


def content_key(made: Plan, view: View, buffers: Iterable[str]) -> str:
    """Hash of all that these buffers of a view depend on, and of this version."""
    keys = Keys(made.book, view, __version__)
    return digest([keys(name) for name in buffers])


def read_by_others(made: Plan, following: Plan | None) -> frozenset[str]:
    """Keys of what `following` has in common with this plan and reads where they part, and of what both make
    once: kept in memory from one to the other, they spare the second all that lies behind them."""
    if following is None:
        return frozenset()
    wanted: set[str] = set()
    for view in following.views:
        if view not in made.views:
            continue
        own, other = (Keys(each.book, view, code()) for each in (made, following))
        common = {step.output for step in following.tile if step.output in made.book}
        common = {name for name in common if own(name) == other(name)}
        asked = {layer.buffer for layer in following.layers} | {"hits", "samples", "alpha"}
        read = {need for step in following.tile if step.output not in common for need in step.inputs.values()}
        wanted |= {other(name) for name in common & (asked | read)}
        wanted |= {other(name) for name in ("implied_widths", *(step.output for step in following.once))}
    return frozenset(wanted)


def _steps(
    book: Mapping[str, Node], wanted: Sequence[Layer], all_views: Sequence[View]
) -> tuple[tuple[Node, ...], tuple[Node, ...]]:
    """What runs once and what runs per tile, each after all it needs."""
    coverage = ["alpha"] if any(layer.buffer == "beauty" for layer in wanted) else []
    nearest = ["samples"] if any(layer.data for layer in wanted) else []
    filled = dict.fromkeys(layer.buffer for layer in wanted)
    if any(view.is_adaptive for view in all_views):
        filled |= dict.fromkeys(SHAPE)
        coverage = ["alpha"]
    told = [name for name in ("repairs", "undirected", "unnamed") if name in book]
    steps = topological_order(book, [*filled, *coverage, *nearest, "hits", "render_space", *told], GIVEN)
    in_tile = set(GIVEN)
    once, tile = [], []
    for step in steps:
        if in_tile & set(step.inputs.values()):
            in_tile.add(step.output)
            tile.append(step)
        else:
            once.append(step)
    return tuple(once), tuple(tile)


def _expected_rays(scene: Any, all_views: Sequence[View], made: set[str]) -> dict[str, int]:
    samples = sum(view.width * view.height * view.samples for view in all_views)
    doubled = sum(doubled_count(view.width, view.height) * view.samples for view in all_views)
    again = {name.removeprefix(AGAIN) for name in made if name.startswith(AGAIN)}
    more = _rays_of(scene, doubled, again)
    return _rays_of(scene, samples, made) | {f"{AGAIN}{name}": count for name, count in more.items()}


def _rays_of(scene: Any, samples: int, made: set[str]) -> dict[str, int]:
    """Rays of so many samples by purpose, where these buffers are made."""
    rays = {"primary": samples} if "hits" in made else {}
    for name, light in scene.named_lights().items():
        if f"shadow:{name}" in made and light.shadows and any(light.color()):
            rays[f"shadow:{name}"] = samples
    if {"obscurance", "obscurance_draws"} <= made and scene.obscurance:
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


def _why_not(scene: Scene, book: Mapping[str, Node], made: set[str]) -> dict[str, str]:
    """A reason for every buffer that is not computed."""
    reasons = {}
    active = active_lights(scene)
    for name in book:
        if name in made or name.startswith(AGAIN):
            continue
        kind, _, light = name.partition(":")
        if kind == "camera":  # made before the plan
            continue
        if light and light not in active:
            reasons[name] = "the light's intensity is 0"
        elif kind in ("shadow", "shadow_candidates") and light and not active[light].shadows:
            reasons[name] = "the light casts no shadows"
        elif name == "obscurance_draws" and any(is_baked(scene)):
            reasons[name] = "the obscurance is baked"
        elif kind in ("obscurance", "obscurance_draws") and scene.obscurance is None:
            reasons[name] = "the scene has no obscurance: w = 1"
        elif kind == "obscurance_normals" and "obscurance_draws" in made:
            reasons[name] = "the hemispheres of obscurance stand about the polygons' own normals"
        elif kind in ("ambient", "ambient_color", "obscurance", "obscurance_draws") and not is_ambient(scene):
            reasons[name] = "no ambient light leaves any surface"
        elif kind == "emission" and not is_emissive(scene):
            reasons[name] = "no material emits"
        else:
            reasons[name] = "no layer asked for reaches it"
    return reasons
