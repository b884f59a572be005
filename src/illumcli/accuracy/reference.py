"""The reference of a convergence measurement: two independent halves, whose difference estimates its error.

References
----------
Efron, B. and Tibshirani, R. (1993). An Introduction to the Bootstrap: split-half estimates of an error.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.accuracy.sampled import SampledLayer, Sampling
from illumcli.cache.fingerprint import digest, fingerprint
from illumcli.cache.store import Store
from illumcli.rays.sampling import stream
from illumcli.records import Value
from illumcli.render_graph.keys import Keys, code

Vary: TypeAlias = Literal["obscurance", "pixels", "both"]

FINER: dict[Vary, tuple[int, int]] = {"obscurance": (1, 4), "pixels": (4, 1), "both": (2, 2)}
"""Factors on samples per pixel and rays per sample of the finest run; together those of a half."""


class Reference(Value):
    """The image that errors are measured against: the mean of two independent halves."""

    sampling: Sampling  # of each half, except for the seed
    rmse: float
    """Root mean square of half the difference of the halves, which is the error of their mean."""
    reused: bool


def reference_image(
    layer: SampledLayer, finest: Sampling, vary: Vary, store: Store | None
) -> tuple[NDArray[np.float64], Reference]:
    """(H, W, channels) the reference, and its error; the halves are cached in the store."""
    # The halves, from the store if it has them.
    halves = reference_halves(layer, finest, vary)
    key = digest([(layer.layer.name, *image_key(layer, half)) for half in halves])
    stored = store.read(key) if store is not None else None
    shape = (layer.view.height, layer.view.width, len(layer.layer.channels))
    arrays = () if stored is None else stored.arrays
    reused = [(each.shape, each.dtype.str) for each in arrays] == [(shape, "<f4")] * 2
    if reused:
        a, b = arrays
    else:
        a, b = (layer.render(half)[0] for half in halves)
        if store is not None:
            store.save(key, {"buffer": "reference", "layer": layer.layer.name}, [a, b])
            store.finish()

    # Their mean and its error.
    error = math.sqrt(np.square((a.astype(np.float64) - b) / 2).mean())
    return (a.astype(np.float64) + b) / 2, Reference(replace(halves[0], seed=0), error, reused)


def reference_halves(layer: SampledLayer, finest: Sampling, vary: Vary) -> list[Sampling]:
    """The samplings of the two halves, with Owen's sampler, so that a bias of the spiral would show."""
    pixel, each = FINER[vary]
    half = Sampling(finest.pixel * pixel, finest.obscurance * each, "owen", 0)
    return [replace(half, seed=stream(layer.scene.seed, f"reference:{name}")) for name in "ab"]


def run_content(layer: SampledLayer, sampling: Sampling, finest: Sampling, vary: Vary) -> str:
    """Hash of everything that an image and its reference depend on."""
    halves = [image_key(layer, half) for half in reference_halves(layer, finest, vary)]
    return digest((layer.layer.name, image_key(layer, sampling), halves))


def image_key(layer: SampledLayer, sampling: Sampling) -> tuple[str, str]:
    """Keys of everything that the image of a layer at a sampling depends on."""
    plan = layer.planned(sampling)
    return Keys(plan.graph.nodes, plan.view, code())(layer.layer.buffer), fingerprint(plan.view)
