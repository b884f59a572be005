"""The nodes that some outputs need, in the order in which they run: once, then per tile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

from illumcli.cache.codec import codec_of
from illumcli.cache.recorder import Cache
from illumcli.film.tiles import TILES, TILES_WITH_MARGINS, Tile, min_tile_samples, tile_side, tiles
from illumcli.film.view import View
from illumcli.graph import Node
from illumcli.layers import FIXED, Layer
from illumcli.records import Value
from illumcli.render_graph.build import GIVEN, SURROUNDINGS, Graph
from illumcli.render_graph.build_adaptive import FITTED, decision
from illumcli.render_graph.cached import Lookup, substitute_cached
from illumcli.render_graph.keys import Keys, code
from illumcli.render_graph.needs import layers, reconstructs
from illumcli.render_graph.replicates import BLOCK, REPLICATED
from illumcli.scene.spec import Scene

REPAIRS = ("repairs", "undirected", "unnamed")
"""Buffers with the repairs of meshes: computed for every scene that has them."""
COVERAGE = {"hits", "samples", "alpha"}
"""Buffers of a tile that the film reads in addition to those of its layers."""
ROW_SAMPLES, LEAST_FITTED = 1 << 20, 96
"""Samples of a row of tiles at most, where obscurance is reconstructed, unless tiles get less than so many
pixels high: all of their margins are fitted, too."""
NOTHING_CACHED = Lookup()


class Plan(Value):
    """The nodes that run for one view, in order: `once`, then `tile` for every tile."""

    graph: Graph
    outputs: tuple[Layer, ...]
    view: View
    """With one sample per pixel if the picture is adaptive."""
    once: tuple[Node, ...]
    tile: tuple[Node, ...]
    lookup: Lookup = NOTHING_CACHED
    before: int = 0
    """Number of a tile's first steps: the later steps read the results of these from the tiles around,
    too."""
    edges_by: int = 0
    """How many of the steps of a tile find the edges of an adaptive picture, if any come `before`."""
    decided_by: int = 0
    """How many of the steps of a tile decide which pixels of an adaptive picture need all samples."""
    all_samples: Plan | None = None
    """The nodes that run for those pixels."""
    replicates: Plan | None = None
    """The nodes that run for the replicates of an adaptive picture whose error is asked for."""
    rows: tuple[int, int] | None = None
    """The rows of the picture that are computed, from the first to before the second; by default all."""

    @property
    def buffers(self) -> set[str]:
        """The names of all buffers that are computed or loaded."""
        replicates = self.replicates.tile if self.replicates else ()
        return {node.output for node in (*self.once, *self.tile, *replicates)}

    @property
    def sampled(self) -> tuple[Layer, ...]:
        """The layers that are made of samples."""
        return of_samples(self.graph, self.outputs, [self.view])

    @property
    def computed(self) -> set[str]:
        """The names of all buffers that are computed."""
        return self.buffers - self.lookup.reused.keys()

    def last_use(self) -> dict[str, int]:
        """Number of the last tile node that reads each buffer of a tile; the film's buffers have none."""
        kept = {layer.buffer for layer in self.sampled} | COVERAGE | {*REPLICATED}
        if self.all_samples:
            kept |= {"obscurance", "edges", FITTED, *(decision(layer) for layer in self.sampled)}
        of_tile = {node.output for node in self.tile}
        last: dict[str, int] = {}
        for number, node in enumerate(self.tile):
            for name in node.inputs.values():
                if name in of_tile and name not in kept:
                    last[name] = number
        return last

    @cached_property
    def with_fit(self) -> tuple[int, ...]:
        """Numbers of the steps of a tile that run where fitted obscurance is given."""
        given = {FITTED: Node(FITTED, dict, {})}
        graph = replace(self.graph, loaders={**self.graph.loaders, **given})
        needed = graph.topological_order(needed_buffers(self.graph, self.outputs, [self.view]))
        names = {node.output for node in needed} - {FITTED}
        return tuple(number for number, node in enumerate(self.tile) if node.output in names)

    @property
    def samples_per_pixel(self) -> int:
        """About how many samples a pixel has; of an adaptive picture a quarter of all, which is many."""
        return self.view.samples if self.all_samples is None else max(1, self.view.stands_for // 4)

    @cached_property
    def uncached_nodes(self) -> int:
        """How many nodes run per tile where nothing is cached. The size of tiles depends on it, not on what
        is cached: buffers of tiles that are in memory fit the tiles of the next variant."""
        if not any(node.inputs for node in self.graph.loaders.values()):
            return len(self.tile)
        needed = needed_buffers(self.graph, self.outputs, [self.view])
        return len(once_and_tile(self.graph.without_loaders().topological_order(needed))[1])

    def tile_side(self, view: View, side: int | None = None) -> int:
        """Pixels along a tile's side: `side` or the default; whole blocks if a layer has errors by block."""
        min_samples = min_tile_samples(self.uncached_nodes)
        if side is None:
            fitted = reconstructs(self.graph.scene)
            count = TILES_WITH_MARGINS if fitted else TILES
            side = tile_side(self.samples_per_pixel, view.width * view.height, min_samples, count)
            if fitted:  # some rows of tiles are held at once
                row = view.width * view.samples
                side = max(min(side, ROW_SAMPLES // row // 8 * 8), min(side, LEAST_FITTED))
        return -(-side // BLOCK) * BLOCK if any(layer.per_pixel for layer in self.outputs) else side

    def rows_of_tiles(self, side: int | None = None) -> list[list[Tile]]:
        """The tiles of the rows that are computed, row by row, of the default size or of another."""
        view, (first, end) = self.view, self.rows or (0, self.view.height)
        return tiles(view.width, end - first, self.tile_side(view, side), self.samples_per_pixel, first)

    def tiles_of_buffers(self) -> Iterator[Tile]:
        """The tiles that buffers are of: those of an adaptive picture have a border."""
        view = self.view
        for row in self.rows_of_tiles():
            for tile in row:
                yield tile if view.adaptive is None else tile.grown(view.border, view.width, view.height)

    def needed_for(self, name: str) -> frozenset[str]:
        """Every buffer that is computed for `name`, itself included; cached buffers are not."""
        needed: set[str] = set()
        pending = [name]
        while pending:
            each = pending.pop()
            if each not in needed and each not in self.lookup.reused and each not in GIVEN:
                needed.add(each)
                pending += self.graph.nodes[each].inputs.values()
        return frozenset(needed)


def outputs_of(scene: Scene, only: Sequence[str] = ()) -> tuple[Layer, ...]:
    """The layers that a scene requests, or `only` those of some names.

    Raises
    ------
    InputError
        Layers that do not exist.
    """
    return tuple(layers(scene, only or scene.outputs.layers))


def error_is_audited(scene: Scene, outputs: Sequence[Layer]) -> bool:
    """Is the layer `error` among these, and made by an audit of the finished picture? So it is where
    obscurance is reconstructed: replicates of a pixel alone cannot be."""
    return reconstructs(scene) and any(layer.per_pixel for layer in outputs)


def needed_buffers(graph: Graph, outputs: Sequence[Layer], shown: Sequence[View]) -> list[str]:
    """The buffers that the film reads to reconstruct layers of some views.

    The hits come first: buffers of tiles that are stored hold values at hits, whether their nodes read them
    or not.
    """
    buffers: dict[str, None] = {"hits": None}
    outputs = of_samples(graph, outputs, shown)
    if any(view.adaptive for view in shown):
        buffers |= dict.fromkeys(decisions(outputs))
        buffers |= dict.fromkeys(_fitted(graph, outputs))
    buffers |= dict.fromkeys(layer.buffer for layer in outputs)
    if any(layer.buffer == "beauty" for layer in outputs):
        buffers["alpha"] = None
    if any(layer.data for layer in outputs):
        buffers["samples"] = None
    repairs = (name for name in REPAIRS if name in graph.nodes)
    return [*(buffers | dict.fromkeys(["render_space", *repairs]))]


def _fitted(graph: Graph, outputs: Sequence[Layer]) -> list[str]:
    """The buffers of fitted obscurance and of the edges that it reads all samples of, if layers need them."""
    needed = graph.without_loaders().topological_order([layer.buffer for layer in outputs])
    return ["edges", FITTED] if any(node.output == FITTED for node in needed) else []


def of_samples(graph: Graph, outputs: Sequence[Layer], shown: Sequence[View]) -> tuple[Layer, ...]:
    """The layers that are made of samples to have these layers of some views."""
    if reconstructs(graph.scene) or any(view.adaptive for view in shown):
        return sampled_outputs(outputs)
    return tuple(outputs)


def sampled_outputs(outputs: Sequence[Layer]) -> tuple[Layer, ...]:
    """The layers that are made of samples where the error is made of the beauty's pixels: in adaptive
    pictures, and where obscurance is reconstructed."""
    sampled = [layer for layer in outputs if not layer.per_pixel]
    needs_beauty = len(sampled) < len(outputs) and FIXED["beauty"] not in sampled
    return (*sampled, *([FIXED["beauty"]] if needs_beauty else []))


def decisions(outputs: Sequence[Layer]) -> list[str]:
    """The buffers that say which pixels of layers need all samples; data, never averaged, needs none."""
    means = [layer for layer in outputs if not layer.data]
    beauty = any(layer.buffer == "beauty" for layer in outputs)  # its alpha comes with it
    return [*dict.fromkeys(decision(layer) for layer in [*means, *([FIXED["alpha"]] if beauty else [])])]


def reached(graph: Graph, outputs: Sequence[Layer]) -> list[str]:
    """The buffers that layers of all views need, in the order in which they are computed."""
    needed = needed_buffers(graph, outputs, graph.views)
    if any(layer.per_pixel for layer in outputs) and REPLICATED[0] in graph.nodes:
        needed += REPLICATED
    return [node.output for node in graph.topological_order(needed)]


def schedule(
    graph: Graph,
    outputs: Sequence[Layer],
    view: View,
    lookup: Lookup = NOTHING_CACHED,
    all_samples: Plan | None = None,
) -> Plan:
    """The nodes that layers of a view need; those that read neither view nor tile run once, not per tile.

    Parameters
    ----------
    all_samples : Plan, optional
        For the pixels of an adaptive picture that need all samples; by default from the same graph.
    """
    once, tile = once_and_tile(graph.topological_order(needed_buffers(graph, outputs, [view])))
    around = any(SURROUNDINGS in node.inputs.values() for node in tile)
    if view.adaptive is None:
        (before,) = _ordered(graph, tile, [["hits", "object_pixels"] if around else []])
        return Plan(graph, tuple(outputs), view, tuple(once), tuple(tile), lookup, before)

    # An adaptive picture: first what decides, at the centres of pixels.
    own = sampled_outputs(outputs)
    means = [layer for layer in own if not layer.data]
    if means and all_samples is None:
        all_samples = schedule(graph, means, view.all_samples())
    pairs = [["hits", "edges"], ["object_pixels"]] if around else [[], []]
    edges_by, before, decided_by = _ordered(graph, tile, [*pairs, decisions(own)])

    # The error compares finished pixels with replicates, which have all samples.
    replicates = None
    if any(layer.per_pixel for layer in outputs) and not reconstructs(graph.scene):
        scene_loaders = {name: node for name, node in graph.loaders.items() if not node.inputs}
        whole = replace(graph, loaders=scene_loaders)
        first, rest = once_and_tile(whole.topological_order(REPLICATED))
        replicates = Plan(graph, (), view.all_samples(), tuple(first), tuple(rest))
    known = {node.output for node in once}
    for other in (all_samples, replicates):
        once += [node for node in (other.once if other else ()) if node.output not in known]
        known |= {node.output for node in once}
    plan = Plan(graph, tuple(outputs), view.centres(), tuple(once), tuple(tile), lookup, before)
    return replace(
        plan, edges_by=edges_by, decided_by=decided_by, all_samples=all_samples, replicates=replicates
    )


def _ordered(graph: Graph, tile: list[Node], groups: Sequence[Sequence[str]]) -> list[int]:
    """Sort the nodes of a tile: those that the first group of buffers needs, those for the next, and so on.

    Returns
    -------
    list of int
        How many nodes come until the end of each group.
    """
    place: dict[str, int] = {}
    for number, group in enumerate(groups):
        for node in graph.topological_order(group):
            place.setdefault(node.output, number)
    tile.sort(key=lambda node: place.get(node.output, len(groups)))
    places = [place.get(node.output, len(groups)) for node in tile]
    return [sum(each <= number for each in places) for number in range(len(groups))]


def uncached_plans(plan: Plan, cache: Cache) -> tuple[Plan, Plan]:
    """Plans of an adaptive picture that load no buffer of a tile: for one sample of pixels, and for all."""
    others = plan.all_samples
    assert others is not None
    if not any(node.inputs for node in (*plan.graph.loaders.values(), *others.graph.loaders.values())):
        return plan, others
    fitted = {name: node for name, node in plan.graph.loaders.items() if name == FITTED}
    graph, centres = replace(plan.graph, loaders=fitted), replace(plan.view, adaptive=None)
    plans = []
    for outputs, view in ((plan.sampled, centres), (others.outputs, others.view)):
        needed = needed_buffers(graph, outputs, [view])
        loaded, lookup = substitute_cached(graph, needed, view, cache, tiles="none")
        plans.append(schedule(loaded, outputs, view, lookup))
    return plans[0], plans[1]


def once_and_tile(nodes: Sequence[Node]) -> tuple[list[Node], list[Node]]:
    """Nodes that run once, and those that run for each tile."""
    of_tile = set(GIVEN)
    for node in nodes:
        if of_tile & set(node.inputs.values()):
            of_tile.add(node.output)
    parts: tuple[list[Node], list[Node]] = ([], [])
    for node in nodes:
        parts[node.output in of_tile].append(node)
    return parts


def lasting_keys(graph: Graph, outputs: Sequence[Layer]) -> frozenset[str]:
    """Keys of the buffers that any change of the scene may leave as they are and that take longer to compute
    than to keep: those of the whole scene, and those that the store would hold."""
    lasting: set[str] = set()
    for view in graph.views:
        plan = schedule(graph, outputs, view)
        for part in (plan, plan.all_samples):
            if part is not None:
                key = Keys(graph.nodes, part.view, code())
                names = [node.output for node in part.tile if _lasts(node.output)]
                lasting |= {
                    key(name) for name in ("implied_widths", *(node.output for node in part.once), *names)
                }
    return frozenset(lasting)


def _lasts(name: str) -> bool:
    """True if a buffer of tiles takes longer to compute than to keep; fitted obscurance is kept whole."""
    return name == FITTED or codec_of(name) is not None


def shared_keys(graph: Graph, following: Graph, outputs: Sequence[Layer]) -> frozenset[str]:
    """Keys of buffers that let `following` skip everything upstream if they are kept in memory.

    These are the buffers that both graphs have and that a node of `following` reads which `graph` lacks, and
    all buffers of the whole scene.
    """
    shared: set[str] = set()
    for view in following.views:
        plan = schedule(following, outputs, view)
        second = Keys(following.nodes, plan.view, code())
        shared |= {second(name) for name in ("implied_widths", *(node.output for node in plan.once))}
        if view not in graph.views:
            continue
        first = Keys(graph.nodes, plan.view, code())
        common = {node.output for node in plan.tile if node.output in graph.nodes}
        common = {name for name in common if first(name) == second(name)}
        read = {name for node in plan.tile if node.output not in common for name in node.inputs.values()}
        read |= {layer.buffer for layer in outputs} | COVERAGE
        read |= {FITTED}  # of the whole view, read by all samples
        shared |= {second(name) for name in common & read}
        if (
            plan.all_samples is not None
        ):  # of some pixels, in the form that the store has, whatever reads them
            second = Keys(following.nodes, plan.all_samples.view, code())
            shared |= {second(name) for name in common if codec_of(name) is not None}
    return frozenset(shared)
