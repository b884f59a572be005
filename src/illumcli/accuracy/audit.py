"""The error of a reconstructed picture, noise and bias together, from rays that are used nowhere else.

At some pixels the layer is estimated twice more, C and D, without reconstruction: with other camera samples
over the pixel filter, and with rays drawn by hash for each pixel. For a picture F the mean of (F - C)(F - D)
is an unbiased estimate of its mean square error, since C and D err independently of F and of each other. The
rays of a picture are one lattice over all pixels; other rays of the same lattice would err together with F.

References
----------
Neyman, J. (1934). On the two different aspects of the representative method. Journal of the Royal Statistical
Society 97(4).
Rousselle, F., Knaus, C. and Zwicker, M. (2012). Adaptive rendering with non-local means filtering. ACM
Transactions on Graphics 31(6): two buffers. Not followed: their halves are part of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats
from illumcli.film.tiles import Tile
from illumcli.film.view import View, samples
from illumcli.graph import Node
from illumcli.layers import Layer
from illumcli.rays.sampling import hashed, stream, unit_interval
from illumcli.records import Record, Value
from illumcli.render_graph.build import Graph
from illumcli.render_graph.execute import Run, at_pixels
from illumcli.render_graph.replicates import replicated_draws
from illumcli.render_graph.schedule import Plan, schedule
from illumcli.visibility.obscurance import obscurance_method

FEWEST_BLOCKS, MOST_BLOCKS = 900, 3600
"""A picture is divided into blocks of about 16 x 16 pixels, but so many at least and at most."""
CANDIDATES = 16
"""Pixels of each block that may be audited."""
PILOT = 2
"""The first of them: their errors determine how many more of each block are audited, with how many rays."""
PRECISION = 0.04
"""Relative standard error of the stated error that the number of pixels is chosen for."""
RAYS = 128
"""Obscurance rays of each estimate of a pixel, at least."""
MOST_RAYS = 1024
LEAST_BUDGET, BUDGET_PER_PIXEL, MOST_BUDGET = 1 << 20, 8, 1 << 23
"""Obscurance rays of an audit, about, by the size of the picture; where they do not reach `PRECISION`, the
stated interval is wider."""
CAMERA_SAMPLES = 16
"""Camera samples of each estimate, where the picture has several per pixel."""


class AuditedError(Value):
    """Root mean square error of a layer, over all pixels and channels."""

    layer: str
    rmse: float
    """0 only if every audited pixel is exact."""
    standard_error: float
    """Of `rmse`."""
    low: float
    high: float
    """Interval that holds the truth in 95 of 100 pictures."""
    pixels: int
    rays: int = 0
    """Of every kind, that the audit took."""

    @classmethod
    def of_products(cls, layer: str, products: Floats, weights: Floats) -> AuditedError:
        """From (K,) products (F - C)(F - D), and the share of the image that each represents."""
        mean = float(products @ weights)
        error = math.sqrt(float(np.square((products - mean) * weights).sum()))
        rmse = math.sqrt(max(mean, error))  # where the mean is lost in its own error, that bounds it
        low, high = (math.sqrt(max(mean + sign * 1.96 * error, 0)) for sign in (-1, 1))
        return cls(layer, rmse, error / (2 * rmse) if rmse else 0.0, low, high, len(products))

    def as_data(self) -> dict[str, str | float]:
        """The error as reports hold it."""
        return dict(vars(self))


class Audit(Record):
    """The audit of one layer of a view: it takes the picture's values as its tiles are finished."""

    plan: Plan
    layer: Layer
    seed: int
    candidates: Candidates
    camera_samples: int | None
    """Of each of C and D, over the pixel filter; None: at the places of the picture's own."""
    precision: float = PRECISION
    taken: list[tuple[NDArray[np.intp], NDArray[np.float64]]] = field(default_factory=list)
    """Numbers of candidates and the picture's values there, (K, channels)."""

    @classmethod
    def of(cls, plan: Plan, layer: Layer, seed: int) -> Audit:
        """The audit of a layer of a plan, antialiased as the plan does it, at pixels that the seed draws."""
        several = plan.view.samples > 1
        camera_samples = max(plan.view.samples, CAMERA_SAMPLES) if several else None
        return cls(plan, layer, seed, Candidates.of(plan.view, seed), camera_samples)

    def take(self, tile: Tile, layers: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values of a finished tile at the candidates; any thread."""
        across, down = self.candidates.x - tile.x, self.candidates.y - tile.y
        inside = (across >= 0) & (across < tile.width) & (down >= 0) & (down < tile.height)
        number = np.flatnonzero(inside)
        values = layers[self.layer.name][down[number], across[number]]
        self.taken.append((number, values.astype(np.float64)))

    def error(self, shared: Mapping[str, Any], run: Run) -> AuditedError:
        """The error of the picture, of which every tile was taken.

        Pilot pixels only determine how many others are audited; they are not part of the estimate.

        Parameters
        ----------
        shared : mapping
            The buffers of the whole scene.
        """
        number, values = (np.concatenate(each) for each in zip(*self.taken, strict=True))
        picture = np.empty_like(values)
        picture[number] = values
        buffers, share = dict(shared), self.candidates.share

        # the pilot: where the picture errs, and how C and D do
        pilot = np.arange(PILOT * len(share))
        products, noise = self._products(pilot, RAYS, "pilot", picture, buffers, run)
        pilot_error = AuditedError.of_products(self.layer.name, products, np.tile(share / PILOT, PILOT))
        if not products.any():
            return replace(pilot_error, rays=sum(run.stats.rays.values()))
        square = max(pilot_error.rmse**2, 1e-12)
        more = max(noise / (2 * square), 1.0) ** (2 / 3)  # noise falls as rays^-1.5
        rays = min(int(RAYS * more), MOST_RAYS)

        # the others, more of them where products vary
        counts = counts_by_block(
            self.candidates.smoothed(np.square(products).reshape(PILOT, -1).mean(axis=0)),
            share,
            2 * self.precision * square,
            max(self._budget() // (2 * rays), len(share)),
        )
        block = np.repeat(np.arange(len(share)), counts)
        turn = np.arange(len(block)) - np.repeat(np.cumsum(counts) - counts, counts)
        which = (PILOT + turn) * len(share) + block
        products, _ = self._products(which, rays, "main", picture, buffers, run)
        stated = AuditedError.of_products(self.layer.name, products, (share / counts)[block])
        return replace(stated, rays=sum(run.stats.rays.values()))

    def _budget(self) -> int:
        """Obscurance rays that the audit may take, about."""
        pixels = self.plan.view.width * self.plan.view.height
        return min(max(BUDGET_PER_PIXEL * pixels, LEAST_BUDGET), MOST_BUDGET)

    def _products(
        self,
        which: NDArray[np.intp],
        rays: int,
        purpose: str,
        picture: NDArray[np.float64],
        buffers: dict[str, Any],
        run: Run,
    ) -> tuple[NDArray[np.float64], float]:
        """(K,) (F - C)(F - D) of some candidates, and the variance of C and D."""
        c, d = (self._fresh(which, rays, f"{purpose}:{half}", buffers, run) for half in ("c", "d"))
        own = picture[which]
        return ((own - c) * (own - d)).mean(axis=1), float(np.square(c - d).mean()) / 2

    def _fresh(
        self, which: NDArray[np.intp], rays: int, purpose: str, buffers: dict[str, Any], run: Run
    ) -> NDArray[np.float64]:
        """(K, channels) the layer at some candidates, not reconstructed, with random numbers of its own."""
        seed = stream(self.seed, f"audit:{purpose}")
        plan = fresh_plan(self.plan, self.layer, rays, seed, self.camera_samples)
        for node in plan.once:
            if node.output not in buffers or node.output == "obscurance_method":
                buffers[node.output] = node.run(buffers)
        x, y = self.candidates.x[which], self.candidates.y[which]
        return at_pixels(plan, buffers, run, x, y)[self.layer.name].astype(np.float64)


def counts_by_block(square: Floats, share: Floats, standard_error: float, budget: int) -> NDArray[np.int64]:
    """(B,) candidates to look at in each block, in proportion to the root of `square` (Neyman 1934).

    Parameters
    ----------
    square : (B,)
        Mean square of what is averaged.
    share : (B,)
        Of the picture.
    standard_error : float
        That the mean is to have; where `budget` candidates do not suffice, it has a larger one.
    """
    deviation = share * np.sqrt(square + 0.05 * square.mean())
    most = CANDIDATES - PILOT
    counts = np.ones(len(share), np.int64)
    for scale in 2.0 ** np.arange(0, 8, 0.5):
        wanted = np.clip(np.round(scale * deviation / deviation.mean()), 1, most).astype(np.int64)
        if wanted.sum() > budget:
            break
        counts = wanted
        if float(np.square(deviation / np.sqrt(counts)).sum()) <= standard_error**2:
            break
    return counts


class Candidates(Record):
    """Pixels that an audit may look at: `CANDIDATES` of each of B blocks, the first of every block first."""

    x: NDArray[np.int64]  # (CANDIDATES * B,) column
    y: NDArray[np.int64]  # (CANDIDATES * B,) row
    share: NDArray[np.float64]  # (B,) of the picture's pixels
    across: int
    """Blocks in a row of them."""

    @classmethod
    def of(cls, view: View, seed: int) -> Candidates:
        """Candidates of a view, drawn by hash: within a block every pixel is as likely."""
        pixels = view.width * view.height
        side = max(1, math.isqrt(pixels // min(max(pixels // 256, FEWEST_BLOCKS), MOST_BLOCKS)))
        across, down = -(-view.width // side), -(-view.height // side)
        row, column = np.divmod(np.arange(across * down), across)
        wide, high = np.minimum(side, view.width - column * side), np.minimum(side, view.height - row * side)
        number = np.arange(CANDIDATES * across * down, dtype=np.uint32)
        key = stream(seed, "audit pixels")
        a, b = (unit_interval(hashed(key + axis & 0xFFFFFFFF, number)) for axis in (0, 1))
        x = np.tile(column * side, CANDIDATES) + (a * np.tile(wide, CANDIDATES)).astype(np.int64)
        y = np.tile(row * side, CANDIDATES) + (b * np.tile(high, CANDIDATES)).astype(np.int64)
        return cls(x, y, wide * high / (view.width * view.height), across)

    def smoothed(self, values: Floats) -> Floats:
        """(B,) mean of the values of each block and its neighbours."""
        grid = values.reshape(-1, self.across)
        near, (rows, columns) = np.pad(grid, 1, mode="edge"), grid.shape
        windows = [near[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
        return np.mean(windows, axis=0).ravel()


def audited_layer(plan: Plan) -> Layer | None:
    """The layer whose error is stated: the beauty, else the first mean of samples that reconstructed
    obscurance is part of; None where there is none."""
    if "raw_obscurance" not in plan.graph.nodes:
        return None
    graph = plan.graph.without_loaders()
    means = [
        layer
        for layer in plan.outputs
        if not layer.data
        and "obscurance" in {node.output for node in graph.topological_order([layer.buffer])}
    ]
    return min(means, key=lambda layer: layer.buffer != "beauty", default=None)


def fresh_plan(plan: Plan, layer: Layer, rays: int, seed: int, camera_samples: int | None) -> Plan:
    """The plan of one layer that is not reconstructed, with so many obscurance rays per pixel.

    Parameters
    ----------
    camera_samples : int, optional
        Over the pixel filter; by default those of `plan`, at their places.
    """
    view, scene, nodes = plan.view, plan.graph.scene, plan.graph.nodes
    assert scene.obscurance is not None
    each = max(1, rays // (camera_samples or view.samples))
    settings = scene.obscurance.model_copy(update={"samples": each, "reconstruct": None})
    changed = [
        Node.of(partial(replicated_draws, seed), "obscurance_draws"),
        replace(nodes["obscurance_method"], function=partial(obscurance_method, settings)),
        replace(nodes["raw_obscurance"], output="obscurance"),
    ]
    if camera_samples is not None:
        changed.append(Node.of(partial(samples, seed), "samples"))
        view = replace(view, samples=camera_samples)
    graph: Graph = replace(plan.graph, nodes={**nodes, **{node.output: node for node in changed}}, loaders={})
    return schedule(graph, [layer], view)
