"""Replaces nodes whose buffers are cached by nodes that load them; nodes that only fed them drop out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import field, replace
from functools import partial
from typing import Any, Literal, TypeAlias

from illumcli.cache.codec import (
    Misfit,
    codec_of,
    decode_entry,
    load_hits,
    load_pixels,
    load_tile,
    stored_buffer,
)
from illumcli.cache.pixels import PixelBuffer, pixel_buffer, pixel_key
from illumcli.cache.policy import SCENE_BUFFERS, is_kept
from illumcli.cache.recorder import Cache
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.graph import Node
from illumcli.records import Value
from illumcli.render_graph.build import GIVEN, Graph
from illumcli.render_graph.build_adaptive import FITTED
from illumcli.render_graph.keys import Keys, code

CachedTiles: TypeAlias = Literal["all", "some", "none"]
"""The pixels for which buffers of tiles are loaded."""


class Lookup(Value):
    """Which buffers of a view are cached, and which are worth caching."""

    reused: Mapping[str, str] = field(default_factory=dict)
    """Buffer -> where it is loaded from: `memory` or `store`."""
    keeps: Mapping[str, str] = field(default_factory=dict)
    """Buffers that are computed and may be kept -> their keys."""
    pixels: Mapping[str, PixelBuffer] = field(default_factory=dict, repr=False)
    """Buffers that are kept for some pixels only."""
    tiles: Mapping[str, Collection[Tile]] = field(default_factory=dict, repr=False)
    """Keys of the buffers that are loaded from memory tile by tile -> their tiles."""


def substitute_cached(
    graph: Graph,
    buffers: Iterable[str],
    view: View,
    cache: Cache,
    look: bool = False,
    tiles: CachedTiles = "all",
) -> tuple[Graph, Lookup]:
    """The graph with nodes that load the cached buffers among all that `buffers` need, and which these are.

    Nodes that load buffers already are kept.

    Parameters
    ----------
    look : bool
        Read nothing: an entry that exists counts as valid, and the graph cannot run.
    tiles : {"all", "some", "none"}
        Load buffers of tiles for all pixels; for those pixels that all of these buffers are cached for; or
        not at all. Fitted obscurance is loaded for all or computed: its fit depends on all pixels.
    """
    keys = Keys(graph.nodes, view, code())
    loaders: dict[str, Node] = dict(graph.loaders)
    reused: dict[str, str] = {}
    keeps: dict[str, str] = {}
    pixels: dict[str, PixelBuffer] = {}
    in_memory: dict[str, Collection[Tile]] = {}

    # Depth first; the inputs of loaded buffers are not visited.
    pending, visited = list(buffers)[::-1], set(GIVEN)
    undecided: list[str] = []  # buffers with a shortcut: is what both nodes read loaded?
    while pending or undecided:
        if not pending:
            name = undecided.pop()
            node = graph.nodes[name]
            if all(need in loaders for need in _shared_inputs(graph, name)):
                node = loaders[name] = graph.shortcuts[name]
            pending += list(node.inputs.values())[::-1]
            continue
        name = pending.pop()
        if name in visited:
            continue
        visited.add(name)
        node = graph.nodes[name]
        reads_fit = FITTED in node.inputs.values()  # w of samples is taken from the fit faster than loaded
        if name in graph.loaders:
            node = graph.loaders[name]
        elif name in graph.known:
            known = graph.known[name]
            node = loaders[name] = Node(name, partial(_constant, known.value), {})
            if known.source:
                reused[name] = known.source
        elif (name == FITTED and tiles != "all") or (name == "obscurance" and reads_fit):
            pass
        elif cache.memory is not None or is_kept(name):
            key = keys(name)
            if tiles == "some" and codec_of(name) is not None:
                keeps[name] = key
                source, loader, buffer = _pixel_loader(name, key, view, cache, look)
                pixels |= {name: buffer} if buffer is not None else {}
            else:
                source, loader = _loader(name, key, view, cache, look, tiles == "all")
            if loader is not None:
                node = loaders[name] = loader
                reused[name] = source
                of_tiles = cache.memory.tiles(key) if cache.memory is not None and tiles == "all" else None
                in_memory |= {key: of_tiles.keys()} if of_tiles is not None else {}
            elif cache.accepts(name):
                keeps[name] = key
        if name in graph.shortcuts and name not in loaders:
            undecided.append(name)
            pending += _shared_inputs(graph, name)
            continue
        pending += list(node.inputs.values())[::-1]
    return replace(graph, loaders=loaders), Lookup(reused, keeps, pixels, in_memory)


def _shared_inputs(graph: Graph, name: str) -> list[str]:
    """The buffers that a node and its shortcut read."""
    own, shorter = graph.nodes[name].inputs.values(), graph.shortcuts[name].inputs.values()
    return [need for need in own if need in shorter]


def _pixel_loader(
    name: str, key: str, view: View, cache: Cache, look: bool
) -> tuple[str, Node | None, PixelBuffer | None]:
    """Where a buffer of some pixels is loaded from, the node that does so and what it reads."""
    load = load_hits if name == "hits" else load_tile
    if cache.memory is not None and key in cache.memory.pixels:
        buffer = cache.memory.pixels[key]
        return "memory", Node(name, partial(load, buffer), _inputs(name)), buffer
    store, codec = cache.store, codec_of(name)
    if store is None or codec is None:
        return "", None, None
    if look:
        known = store.has(pixel_key(key))
        return "store", Node(name, _constant, _inputs(name)) if known else None, None
    stored = store.read(pixel_key(key))
    if stored is None:
        return "", None, None
    try:
        buffer = pixel_buffer(codec, stored, view)
    except Misfit:
        store.reject(pixel_key(key), f"holds something else than {name.partition(':')[0]} of some pixels")
        return "", None, None
    return "store", Node(name, partial(load, buffer), _inputs(name)), buffer


def _loader(
    name: str, key: str, view: View, cache: Cache, look: bool, of_tiles: bool
) -> tuple[str, Node | None]:
    """Where a buffer is loaded from, and the node that does so; None if it must be computed."""
    memory, store = cache.memory, cache.store

    # In memory: the buffer of the whole scene, or of every tile.
    if memory is not None:
        if key in memory.once:
            return "memory", Node(name, partial(_constant, memory.once[key]), {})
        tiles = memory.tiles(key) if of_tiles else None
        if tiles is not None:
            return "memory", Node(name, partial(_of_tile, tiles), {"tile": "tile"})

    # On disk: a valid entry that holds the type of value that its key promises.
    codec = codec_of(name)
    if store is None or not is_kept(name) or (codec is not None and not of_tiles):
        return "", None
    if look:
        return "store", Node(name, _constant, _inputs(name)) if store.has(key) else None
    stored = store.read(key)
    if stored is None:
        return "", None
    try:
        if codec is None:
            value = decode_entry(stored, SCENE_BUFFERS[name.partition(":")[0]])
            if memory is not None:
                memory.once[key] = value
            return "store", Node(name, partial(_constant, value), {})
        load = load_hits if name == "hits" else load_pixels if codec.of_pixels else load_tile
        return "store", Node(name, partial(load, stored_buffer(codec, stored, view)), _inputs(name))
    except Misfit:
        store.reject(key, f"holds something else than {name.partition(':')[0]}")
        return "", None


def _inputs(name: str) -> dict[str, str]:
    """The inputs of a node that loads the buffer `name`."""
    codec = codec_of(name)
    if codec is None:
        return {}
    return {"tile": "tile"} if name == "hits" or codec.of_pixels else {"tile": "tile", "hits": "hits"}


def _constant(value: Any) -> Any:
    return value


def _of_tile(tiles: Mapping[Tile, Any], tile: Tile) -> Any:
    return tiles[tile]
