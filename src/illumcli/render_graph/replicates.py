"""Standard error of an image: some pixels are rendered a second time, with separate random numbers.

Half the squared difference of two independent renders of a pixel is an unbiased estimate of its variance,
whatever the source: edges within the pixel, obscurance, or both. One pixel of every 2 x 2 cell is replicated,
and the 16 estimates of a block of 8 x 8 pixels are averaged. Replicates are never part of the image.
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

REPLICATE = "replicate."
"""Prefix of the names of all buffers of the replicates."""
REPLICATED = (f"{REPLICATE}samples", f"{REPLICATE}luminance")
"""The buffers of the replicates that the error reads."""
CELL = 2
"""Side of a cell, of which one pixel is replicated [pixels]."""
BLOCK = 8
"""Side of a block, whose pixels have one error [pixels]; blocks begin at the film's upper left corner."""


def error_nodes(
    nodes: Mapping[str, Node],
    seed: int,
    background: tuple[float, float, float] | None,
    samples: Sequence[int],
    given: Sequence[str],
) -> dict[str, Node]:
    """The nodes of the layer `error`: a copy of every node from `samples` to the luminance of `beauty`.

    Parameters
    ----------
    nodes : mapping
        All other nodes of the scene, by output.
    background : 3 floats, optional
        Colour behind the surfaces; black if the image has an alpha channel instead.
    samples : ints
        Per pixel, of every view. A single sample is at its pixel's centre; if no obscurance is traced either,
        nothing is random, the error is 0 and no pixel is replicated.
    given : names
        Buffers that need no node.
    """
    # If nothing is random the error is 0.
    to_luminance = Node.of(partial(luminance, background or (0.0, 0.0, 0.0)), "luminance")
    originals = topological_order({**nodes, "luminance": to_luminance}, ["luminance"], given)
    is_traced = "obscurance_draws" in {node.output for node in originals}
    if max(samples) == 1 and not is_traced:
        return {"error": Node.of(no_error, "error")}

    # Copy all that depends on the samples, which get other random numbers.
    replicated = {"samples"}
    copies = [to_luminance, Node.of(partial(replicated_samples, seed), f"{REPLICATE}samples")]
    for node in originals:
        if replicated.isdisjoint(node.inputs.values()):
            continue
        replicated.add(node.output)
        inputs = {p: f"{REPLICATE}{name}" if name in replicated else name for p, name in node.inputs.items()}
        draws_again = node.output == "obscurance_draws"
        function = partial(replicated_draws, seed) if draws_again else node.function
        copies.append(Node(f"{REPLICATE}{node.output}", function, inputs))

    # The error compares both luminances.
    second = dict(zip(("replicated", "second"), REPLICATED, strict=True))
    copies.append(Node.of(standard_error, "error", first="luminance", **second))
    return {node.output: node for node in copies}


def replicated_count(width: int, height: int) -> int:
    """Number of replicated pixels of a film."""
    return -(-width // CELL) * -(-height // CELL)


def replicated_samples(seed: int, view: View, tile: Tile) -> Samples:
    """The replicates' samples: in one pixel of each cell of the tile, which is drawn at random."""
    # The upper left pixel of each cell.
    cells = [
        np.arange(first, first + size, CELL)
        for first, size in ((tile.x, tile.width), (tile.y, tile.height))
    ]  # fmt: skip
    y, x = (each.ravel() for each in np.meshgrid(cells[1], cells[0], indexing="ij"))

    # Draw a pixel of it, and samples in the pixel.
    wide, high = _cell(view, x, y)
    cell = (y * view.width + x).astype(np.uint32)
    key = sampling.stream(seed, "doubled")
    a, b = (sampling.unit_interval(sampling.hashed(key + axis & 0xFFFFFFFF, cell)) for axis in (0, 1))
    x, y = x + (a * wide).astype(np.int64), y + (b * high).astype(np.int64)
    pixel = (y * view.width + x).astype(np.uint32)
    points = sampling.pixel_points(sampling.stream(seed, "pixel again"), pixel, view.samples)
    return Samples(x, y, points, view.samples)


def _cell(view: View, x: NDArray[np.int64], y: NDArray[np.int64]) -> tuple[Ids, Ids]:
    """Width and height of the cells of some pixels; the film's right and lower edges may cut a cell."""
    return (
        np.minimum(CELL, view.width - x // CELL * CELL),
        np.minimum(CELL, view.height - y // CELL * CELL),
    )


def replicated_draws(seed: int, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): rotation and phase of the replicates' obscurance rays.

    The draws of one pixel's samples have the same differences as in the image, but each pixel has its own
    offset: over the film, the image's draws are one pattern that the seed only shifts.
    """
    return numbered_draws(seed, (samples.y * (1 << 16) + samples.x).astype(np.uint32), samples, hits)


def numbered_draws(
    seed: int, number: NDArray[np.uint32], samples: Samples, hits: Hits
) -> NDArray[np.float64]:
    """(2, M) the same by a number of each of P pixels, (P,)."""
    key = sampling.stream(seed, "obscurance again")
    pixel, sample = np.divmod(hits.sample, samples.per_pixel)
    zero = np.zeros_like(sample)
    within = sampling.dither(key, zero, zero, sample)
    start = [sampling.unit_interval(sampling.hashed(key + k & 0xFFFFFFFF, number)) for k in (2, 3)]
    return (within + np.stack(start).take(pixel, axis=1)) % 1.0


def no_error(tile: Tile) -> Floats:
    """(P,) 0 at every pixel: nothing in the image is random."""
    return np.zeros(tile.width * tile.height, F)


def standard_error(
    view: View, tile: Tile, replicated: Samples, first: NDArray[np.float64], second: NDArray[np.float64]
) -> Floats:
    """(P,) float32 standard error of the luminance of every pixel, the same for all pixels of a block.

    The tile consists of whole blocks, except at the film's edges. Cells that an edge cuts have fewer pixels
    to draw from, and weigh less.

    Parameters
    ----------
    replicated
        The samples of the replicates.
    first : (P,)
        Luminance of the tile's pixels.
    second : (D,)
        Luminance of the replicates.
    """
    # An estimate of the variance from each replicate.
    x, y = replicated.x, replicated.y
    half = np.square(first[(y - tile.y) * tile.width + x - tile.x] - second) / 2
    wide, high = _cell(view, x, y)
    weight = wide * high

    # The mean of each block, for all of its pixels.
    across = -(-tile.width // BLOCK)
    block = (y - tile.y) // BLOCK * across + (x - tile.x) // BLOCK
    variance = np.bincount(block, weight * half) / np.bincount(block, weight)
    column, row = tile.pixels()
    block_of_pixel = (row - tile.y) // BLOCK * across + (column - tile.x) // BLOCK
    return np.sqrt(variance).astype(F)[block_of_pixel]


def pixel_luminance(
    background: tuple[float, float, float], beauty: NDArray[np.float32], alpha: NDArray[np.float32]
) -> NDArray[np.float64]:
    """(P,) the same of finished pixels, (h, w, 3) and (h, w, 1)."""
    weights = np.array(LUMINANCE)
    return np.asarray(beauty @ weights - alpha[..., 0] * (weights @ background)).ravel()


def luminance(
    background: tuple[float, float, float], samples: Samples, hits: Hits, beauty: Vectors
) -> NDArray[np.float64]:
    """(P,) difference between each pixel's luminance and that of the background."""
    weights = np.array(LUMINANCE)
    difference = (beauty @ weights.astype(F)) - F(weights @ background)
    return pixel_means(difference, hits.sample, len(samples.x), samples.per_pixel)[:, 0].astype(np.float64)
