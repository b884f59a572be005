"""Standard error of a picture: some pixels are rendered a second time, with separate random numbers.

Half the squared difference of two independent renders of a pixel is an unbiased estimate of its variance,
whatever the source: edges within the pixel, obscurance, or both. One pixel of every 2 x 2 cell is replicated,
and the 16 estimates of a block of 8 x 8 pixels are averaged. The replicates are never part of the picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors
from illumcli.color import LUMINANCE
from illumcli.film.reconstruct import pixel_means
from illumcli.film.tiles import Samples, Tile
from illumcli.film.view import View
from illumcli.graph import Node, topological_order
from illumcli.rays import sampling
from illumcli.rays.interaction import Hits

AGAIN = "again."
"""Before the name of every buffer of the second pictures."""
CELL = 2
"""One pixel in so many across and down is doubled."""
BLOCK = 8
"""Pixels along a block, which has one error; blocks begin at the film's upper left corner."""


def error_recipes(
    book: Mapping[str, Node],
    seed: int,
    background: tuple[float, float, float] | None,
    samples: Sequence[int],
    given: Sequence[str],
) -> dict[str, Node]:
    """The extra nodes of the layer `error`: a copy of every node from `samples` to the luminance of `beauty`.

    Parameters
    ----------
    background : 3 floats, optional
        Colour behind the surfaces; black where they have an alpha instead.
    samples : ints
        Per pixel, of every view. A single one stands at its pixel's centre: where no obscurance is traced
        either, nothing is random, the error is 0 and no pixel is doubled.
    given : names
        Buffers that need no recipe.
    """
    picture = Node.of(partial(luminance, background or (0.0, 0.0, 0.0)), "luminance")
    steps = topological_order({**book, "luminance": picture}, ["luminance"], given)
    traced = "obscurance_draws" in {step.output for step in steps}
    if max(samples) == 1 and not traced:
        return {"error": Node.of(no_error, "error")}
    copied = {"samples"}
    made = [picture, Node.of(partial(doubled_samples, seed), f"{AGAIN}samples")]
    for step in steps:
        if copied.isdisjoint(step.inputs.values()):
            continue
        copied.add(step.output)
        needs = {p: f"{AGAIN}{need}" if need in copied else need for p, need in step.inputs.items()}
        function = partial(doubled_draws, seed) if step.output == "obscurance_draws" else step.function
        made.append(Node(f"{AGAIN}{step.output}", function, needs))
    again = {"doubled": f"{AGAIN}samples", "second": f"{AGAIN}luminance"}
    made.append(Node.of(standard_error, "error", first="luminance", **again))
    return {recipe.output: recipe for recipe in made}


def doubled_count(width: int, height: int) -> int:
    """How many pixels of a film are doubled."""
    return -(-width // CELL) * -(-height // CELL)


def doubled_samples(seed: int, view: View, tile: Tile) -> Samples:
    """Where the second samples of the tile's doubled pixels lie: one pixel of each cell, drawn at random."""
    cells = [
        np.arange(first, first + size, CELL)
        for first, size in ((tile.x, tile.width), (tile.y, tile.height))
    ]  # fmt: skip
    y, x = (each.ravel() for each in np.meshgrid(cells[1], cells[0], indexing="ij"))
    wide, high = _cell(view, x, y)
    cell = (y * view.width + x).astype(np.uint32)
    key = sampling.stream(seed, "doubled")
    a, b = (sampling.unit_interval(sampling.hashed(key + axis & 0xFFFFFFFF, cell)) for axis in (0, 1))
    x, y = x + (a * wide).astype(np.int64), y + (b * high).astype(np.int64)
    pixel = (y * view.width + x).astype(np.uint32)
    points = sampling.pixel_points(sampling.stream(seed, "pixel again"), pixel, view.samples)
    return Samples(x, y, points, view.samples)


def _cell(view: View, x: NDArray[np.int64], y: NDArray[np.int64]) -> tuple[Ids, Ids]:
    """Width and height of the cells of some pixels, which the film's right and lower edges may cut."""
    return (
        np.minimum(CELL, view.width - x // CELL * CELL),
        np.minimum(CELL, view.height - y // CELL * CELL),
    )


def doubled_draws(seed: int, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): what the second obscurance rays are turned and phased by.

    The samples of one pixel stand to each other as in the first picture, but every pixel begins anew: over
    the film the first picture's draws are one pattern that the seed only shifts.
    """
    key = sampling.stream(seed, "obscurance again")
    pixel, sample = np.divmod(hits.sample, samples.per_pixel)
    zero = np.zeros_like(sample)
    within = sampling.dither(key, zero, zero, sample)
    number = (samples.y * (1 << 16) + samples.x).astype(np.uint32)
    start = [sampling.unit_interval(sampling.hashed(key + k & 0xFFFFFFFF, number)) for k in (2, 3)]
    return (within + np.stack(start).take(pixel, axis=1)) % 1.0


def no_error(tile: Tile) -> Floats:
    """(P,) 0 at every pixel: nothing in the picture is random."""
    return np.zeros(tile.width * tile.height, F)


def standard_error(
    view: View, tile: Tile, doubled: Samples, first: NDArray[np.float64], second: NDArray[np.float64]
) -> Floats:
    """(P,) float32 standard error of the luminance of every pixel, the same all over a block.

    The tile begins at a block's corner and ends at one or at the film's edge. Cells that the edge cuts have
    fewer pixels to draw from, and weigh less.

    Parameters
    ----------
    doubled
        The samples of the second picture.
    first, second : (P,), (D,)
        Luminance of the tile's pixels, and of the doubled ones as rendered the second time.
    """
    x, y = doubled.x, doubled.y
    half = np.square(first[(y - tile.y) * tile.width + x - tile.x] - second) / 2
    wide, high = _cell(view, x, y)
    weight = wide * high
    across = -(-tile.width // BLOCK)
    block = (y - tile.y) // BLOCK * across + (x - tile.x) // BLOCK
    variance = np.bincount(block, weight * half) / np.bincount(block, weight)
    column, row = tile.pixels()
    own = (row - tile.y) // BLOCK * across + (column - tile.x) // BLOCK
    return np.sqrt(variance).astype(F)[own]


def luminance(
    background: tuple[float, float, float], samples: Samples, hits: Hits, beauty: Vectors
) -> NDArray[np.float64]:
    """(P,) luminance of pixels above that of the background."""
    weights = np.array(LUMINANCE)
    seen = (beauty @ weights.astype(F)) - F(weights @ background)
    return pixel_means(seen, hits.sample, len(samples.x), samples.per_pixel)[:, 0].astype(np.float64)
