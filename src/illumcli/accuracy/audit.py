"""The error of a reconstructed picture, noise and bias together, from rays that are used nowhere else.

At some pixels the layer is estimated twice more, C and D, without reconstruction: with other camera samples
over the pixel filter, and with rays drawn by hash for each draw of a pixel. For a picture F the mean of
(F - C)(F - D) is an unbiased estimate of its mean square error, since C and D err independently of F and of
each other. The rays of a picture are one lattice over all pixels; other rays of the same lattice would err
together with F.

References
----------
Rousselle, F., Knaus, C. and Zwicker, M. (2012). Adaptive rendering with non-local means filtering. ACM
Transactions on Graphics 31(6): two buffers. Not followed: their halves are part of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.accuracy.error_law import standard_errors
from illumcli.accuracy.sampled_blocks import SampledBlocks
from illumcli.arrays import F, Floats
from illumcli.color import LUMINANCE
from illumcli.film.adaptive import around
from illumcli.film.tiles import Samples, Scattered, Tile
from illumcli.film.view import View
from illumcli.graph import Node
from illumcli.layers import FIXED, Layer
from illumcli.rays.interaction import Hits
from illumcli.rays.sampling import hashed, pixel_points, stream, unit_interval
from illumcli.records import Record, Value
from illumcli.render_graph.build import Graph
from illumcli.render_graph.execute import Run, at_pixels
from illumcli.render_graph.replicates import numbered_draws
from illumcli.render_graph.schedule import Plan, error_is_audited, schedule
from illumcli.visibility.obscurance import obscurance_method

FEWEST_PILOTS, MOST_PILOTS = 1800, 7200
"""Pixels whose errors determine how many more are audited, with how many rays: one in 512, within these."""
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
    draws: int
    """Of pixels; one that was drawn twice counts twice, each time with other rays."""
    rays: int = 0
    """Of every kind, that the audit took."""

    @classmethod
    def of_products(cls, layer: str, products: Floats, weights: Floats) -> AuditedError:
        """From (K,) products (F - C)(F - D) and their weights, whose expected sum is 1."""
        terms = products * weights * len(products)
        mean = float(terms.mean())
        error = float(terms.std()) / math.sqrt(max(len(terms) - 1, 1))
        rmse = math.sqrt(max(mean, error))  # if noise exceeds the mean, the noise bounds it
        low, high = (math.sqrt(max(mean + sign * 1.96 * error, 0)) for sign in (-1, 1))
        return cls(layer, rmse, error / (2 * rmse) if rmse else 0.0, low, high, len(products))

    def __str__(self) -> str:
        return f"RMSE of {self.layer}: {self.rmse:.3g} (95 %: {self.low:.3g} to {self.high:.3g})"

    def as_data(self) -> dict[str, str | float]:
        """The error as reports hold it."""
        return dict(vars(self))


class Draws(Record):
    """The K draws of pixels that state the error."""

    pixel: NDArray[np.int64]  # (K,)
    weights: NDArray[np.float64]  # (K,) their expected sum is 1
    first: NDArray[np.float64]  # (K, channels) F - C
    second: NDArray[np.float64]  # (K, channels) F - D

    @property
    def products(self) -> NDArray[np.float64]:
        """(K,) (F - C)(F - D), means over the channels."""
        return np.asarray((self.first * self.second).mean(axis=1))

    @property
    def luminance_products(self) -> NDArray[np.float64]:
        """(K,) the same of the luminance, of a layer of three channels."""
        return np.asarray((self.first @ LUMINANCE) * (self.second @ LUMINANCE))

    @property
    def variance(self) -> float:
        """Variance of C and D."""
        return float(np.square(self.first - self.second).mean()) / 2


class Audit(Record):
    """The audit of one layer of a view: it takes the picture's values as its tiles are finished."""

    plan: Plan
    layer: Layer
    seed: int
    picture: SampledBlocks
    camera_samples: int | None
    """Of each of C and D, over the pixel filter; None: at the places of the picture's own."""
    precision: float = PRECISION

    @classmethod
    def of(cls, plan: Plan, layer: Layer, seed: int) -> Audit:
        """The audit of a layer of a plan, antialiased as the plan does it, at pixels that the seed draws."""
        view = plan.view
        samples = view.samples * view.stands_for
        camera_samples = max(samples, CAMERA_SAMPLES) if samples > 1 else None
        picture = SampledBlocks.of(view, len(layer.channels), seed)
        return cls(plan, layer, seed, picture, camera_samples)

    def take(self, tile: Tile, layers: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values of a finished tile; any thread."""
        self.picture.take(tile, self._shown(layers))

    def _shown(self, layers: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The layer's pixels; the beauty over its background."""
        values = np.asarray(layers[self.layer.name], F)
        background = self.plan.graph.scene.film.background
        if self.layer.buffer != "beauty" or background is None:
            return values
        return values + (1 - layers["alpha"]) * np.asarray(background, F)

    def error(self, shared: Mapping[str, Any], run: Run) -> AuditedError:
        """The error of the picture, of which every tile was taken; see `measured`."""
        return self.measured(shared, run)[0]

    def measured(
        self, shared: Mapping[str, Any], run: Run, advance: Callable[[int], None] = lambda _: None
    ) -> tuple[AuditedError, Draws]:
        """The error of the picture, of which every tile was taken, and the draws that state it.

        Pixels that determine how many are audited do not state the error.

        Parameters
        ----------
        shared : mapping
            The buffers of the whole scene.
        advance : callable
            Called with 0 before each part; an exception that it raises ends the audit.
        """
        buffers = dict(shared)
        advance(0)
        chances = pixel_chances(self.picture.values) * self.picture.is_inside
        chances /= chances.sum()

        # The pilot: how large the error is, how unevenly it is spread, and how noisy C and D are.
        number = min(max(chances.size // 512, FEWEST_PILOTS), MOST_PILOTS)
        draws = self._draws(chances, number, RAYS, "pilot", buffers, run)
        pilot = AuditedError.of_products(self.layer.name, draws.products, draws.weights)
        if not pilot.rmse:
            return replace(pilot, rays=sum(run.stats.rays.values())), draws
        more = max(draws.variance / (2 * pilot.rmse**2), 1.0) ** (2 / 3)  # noise falls as rays^-1.5
        rays = min(int(RAYS * more), MOST_RAYS)

        # The audit itself.
        advance(0)
        wanted = number * (pilot.standard_error / pilot.rmse / self.precision) ** 2
        number = int(min(max(wanted, number), max(self._budget() // (2 * rays), number)))
        draws = self._draws(chances, number, rays, "main", buffers, run)
        stated = AuditedError.of_products(self.layer.name, draws.products, draws.weights)
        return replace(stated, rays=sum(run.stats.rays.values())), draws

    def pixel_errors(self, draws: Draws) -> NDArray[np.float32]:
        """(H, W, 1) float32 standard error of the luminance of every pixel, of a picture that is held whole.

        Parameters
        ----------
        draws : Draws
            From `measured`.
        """
        picture = self.picture.values
        by_pixel = standard_errors(contrasts(picture), draws.pixel, draws.luminance_products, draws.weights)
        return by_pixel.reshape(*picture.shape[:2], 1)

    def _budget(self) -> int:
        """Obscurance rays that the audit may take, about."""
        pixels = self.plan.view.width * self.plan.view.height
        return min(max(BUDGET_PER_PIXEL * pixels, LEAST_BUDGET), MOST_BUDGET)

    def _draws(
        self,
        chances: NDArray[np.float64],
        number: int,
        rays: int,
        purpose: str,
        buffers: dict[str, Any],
        run: Run,
    ) -> Draws:
        """So many pixels, drawn by chance, and estimates with so many obscurance rays there."""
        start = float(
            unit_interval(hashed(stream(self.seed, f"audit pixels:{purpose}"), np.zeros(1, np.uint32)))[0]
        )
        pixel = drawn(chances, number, start)
        x, y = (np.tile(each, 2) for each in self.picture.pixels(pixel))
        c, d = np.split(self._fresh(x, y, rays, purpose, buffers, run), 2)
        own = self.picture.values.reshape(chances.size, -1)[pixel].astype(np.float64)
        weights = 1 / (chances[pixel] * np.count_nonzero(self.picture.is_inside) * number)
        return Draws(pixel, weights, own - c, own - d)

    def _fresh(
        self,
        x: NDArray[np.int64],
        y: NDArray[np.int64],
        rays: int,
        purpose: str,
        buffers: dict[str, Any],
        run: Run,
    ) -> NDArray[np.float64]:
        """(K, channels) the layer at K pixels, not reconstructed, with random numbers of its own for each of
        them, which may be the same pixel."""
        seed = stream(self.seed, f"audit:{purpose}")
        plan = fresh_plan(self.plan, self.layer, rays, seed, self.camera_samples)
        for node in plan.once:
            if node.output not in buffers or node.output == "obscurance_method":
                buffers[node.output] = node.run(buffers)
        return self._shown(at_pixels(plan, buffers, run, x, y)).astype(np.float64)


def pixel_chances(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """(H * W,) chance of each pixel at each draw: a third the same for all, a third by the contrast around
    it, and a third by its square, since most of the error is at edges and highlights."""
    contrast = contrasts(picture).astype(np.float64)
    chances = np.full(contrast.size, 1 / contrast.size)
    if not contrast.any():
        return chances
    square = np.square(contrast)
    return (chances + contrast / contrast.sum() + square / square.sum()) / 3


def contrasts(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H * W,) range of the values, means over the channels, in the 3 x 3 pixels around each pixel."""
    values = np.zeros(picture.shape[:2], F)
    for channel in range(picture.shape[2]):  # a mean over the last axis takes ten times as long
        values += picture[..., channel]
    values /= F(picture.shape[2])
    return np.asarray((around(values, np.maximum, 1) - around(values, np.minimum, 1)).ravel())


def drawn(chances: NDArray[np.float64], number: int, start: float) -> NDArray[np.int64]:
    """(number,) indices drawn by their chances, evenly over their order (systematic sampling)."""
    cumulative = np.cumsum(chances)
    at = (np.arange(number) + start) / number * cumulative[-1]
    return np.minimum(np.searchsorted(cumulative, at, side="right"), chances.size - 1)


def audited_layer(plan: Plan) -> Layer | None:
    """The layer whose error is stated: the beauty, else the first mean of samples that reconstructed
    obscurance is part of; None where there is none. The layer `error` always is that of the beauty."""
    if "raw_obscurance" not in plan.graph.nodes:
        return None
    if error_is_audited(plan.graph.scene, plan.outputs):
        return FIXED["beauty"]
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
        Over the pixel filter; by default all of those of `plan`, at their places.
    """
    scene, nodes = plan.graph.scene, plan.graph.nodes
    view = plan.all_samples.view if plan.all_samples else plan.view
    assert scene.obscurance is not None
    each = max(1, rays // (camera_samples or view.samples))
    settings = scene.obscurance.model_copy(update={"samples": each, "reconstruct": None})
    changed = [
        Node.of(partial(fresh_draws, seed), "obscurance_draws"),
        replace(nodes["obscurance_method"], function=partial(obscurance_method, settings)),
        replace(nodes["raw_obscurance"], output="obscurance"),
    ]
    if camera_samples is not None:
        changed.append(Node.of(partial(fresh_samples, seed), "samples"))
        view = replace(view, samples=camera_samples)
    graph: Graph = replace(plan.graph, nodes={**nodes, **{node.output: node for node in changed}}, loaders={})
    return schedule(graph, [layer], view)


def fresh_samples(seed: int, view: View, tile: Scattered) -> Samples:
    """Sample positions of pixels, keyed by draw: a pixel that is drawn twice has other samples."""
    x, y = tile.pixels()
    return Samples(x, y, pixel_points(stream(seed, "pixel"), tile.numbers(), view.samples), view.samples)


def fresh_draws(seed: int, tile: Scattered, samples: Samples, hits: Hits) -> NDArray[np.float64]:
    """(2, M) in [0, 1): rotation and phase of the obscurance rays, keyed by draw."""
    return numbered_draws(seed, tile.numbers(), samples, hits)
