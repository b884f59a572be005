"""Means over those samples of a pixel that hit one object, for the reconstruction of w."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats
from illumcli.film.tiles import Samples, Tile
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.records import Record
from illumcli.visibility.hemisphere import Hemispheres


class ObjectPixels(Record):
    """Means over the samples of G pairs of a pixel and an object in it.

    A pixel at an object's edge has a pair for each object.
    """

    x: NDArray[np.int32]  # (G,) column of the film
    y: NDArray[np.int32]  # (G,) row
    object: NDArray[np.int32]  # (G,)
    share: NDArray[np.float32]  # (G,) of the pixel's samples, in (0, 1]
    hidden: NDArray[np.float32]  # (G,) 1 - w
    features: NDArray[np.float32]  # (6, G) the normal that w is taken about, the position [radii]

    def take(self, index: NDArray[np.intp]) -> ObjectPixels:
        """These pairs, in this order."""
        return ObjectPixels(
            self.x.take(index),
            self.y.take(index),
            self.object.take(index),
            self.share.take(index),
            self.hidden.take(index),
            self.features.take(index, axis=1),
        )


def joined(parts: Sequence[ObjectPixels]) -> ObjectPixels:
    """The pairs of several tiles."""
    return ObjectPixels(
        np.concatenate([part.x for part in parts]),
        np.concatenate([part.y for part in parts]),
        np.concatenate([part.object for part in parts]),
        np.concatenate([part.share for part in parts]),
        np.concatenate([part.hidden for part in parts]),
        np.concatenate([part.features for part in parts], axis=1),
    )


class SampledPixels(Record):
    """The means of a tile's pairs, and the pair of each sample."""

    pixels: ObjectPixels
    pair_of_sample: NDArray[np.int64]  # (M,) -1 where w is baked

    def to_samples(self, w: Floats, values: Floats) -> Floats:
        """(M,) `values`, (G,), at the samples of each pair; `w` itself where it is baked."""
        traced = self.pair_of_sample >= 0
        if traced.all():
            return values.take(self.pair_of_sample)
        out = w.copy()
        out[traced] = values.take(self.pair_of_sample[traced])
        return out


class PixelPairs(Record):
    """The G pairs of a pixel and an object in it, and the K samples of each, in the order of the pairs."""

    samples: NDArray[np.int64]  # (K,) those whose w is traced
    first: NDArray[np.int64]  # (G,) index of each pair's first one in `samples`
    pair_of_sample: NDArray[np.int64]  # (M,) -1 where w is baked
    pixel: NDArray[np.int64]  # (G,) number within the tile
    object: NDArray[np.int32]  # (G,)


def pixel_pairs(
    samples: Samples, hits: Hits, object_id: NDArray[np.uint32], baked_obscurance: Floats | None = None
) -> PixelPairs:
    """The pairs of a tile's hits, pixel by pixel.

    Parameters
    ----------
    baked_obscurance : (M,) float32, optional
        NaN on meshes that have no baked values; hits on other meshes are in no pair.
    """
    traced = np.arange(len(hits.sample))
    if baked_obscurance is not None:
        traced = np.flatnonzero(np.isnan(baked_obscurance))

    # Sort the samples by pixel and object.
    pixel = hits.sample.take(traced).astype(np.int64) // samples.per_pixel
    objects = object_id.take(traced)
    key = pixel * (int(objects.max(initial=0)) + 1) + objects
    if (np.diff(key) < 0).any():
        order = np.argsort(key, kind="stable")
        traced, pixel, objects, key = traced[order], pixel[order], objects[order], key[order]

    # A pair begins where the pixel or the object changes.
    is_first = np.diff(key, prepend=-1) != 0
    first = np.flatnonzero(is_first)
    pair_of_sample = np.full(len(hits.sample), -1)
    pair_of_sample[traced] = np.cumsum(is_first) - 1
    return PixelPairs(traced, first, pair_of_sample, pixel[first], objects[first].astype(np.int32))


def object_pixels(
    samples: Samples,
    pixel_pairs: PixelPairs,
    hemispheres: Hemispheres,
    interaction: SurfaceInteraction,
    raw_obscurance: Floats,
) -> SampledPixels:
    """Means over the samples of each pair.

    Parameters
    ----------
    raw_obscurance : (M,) float32
        w by the rays of each sample alone.
    """
    traced, first = pixel_pairs.samples, pixel_pairs.first
    count = np.diff(first, append=len(traced))
    hidden = 1 - raw_obscurance.take(traced).astype(np.float64)
    features = [*hemispheres.n.T, *interaction.position.T]
    means = [hidden, *(each.take(traced).astype(np.float64) for each in features)]
    if samples.per_pixel > 1:
        means = [np.add.reduceat(each, first) / count if len(first) else each for each in means]
    pixels = ObjectPixels(
        samples.x.take(pixel_pairs.pixel).astype(np.int32),
        samples.y.take(pixel_pairs.pixel).astype(np.int32),
        pixel_pairs.object,
        (count / samples.per_pixel).astype(F),
        means[0].astype(F),
        np.stack(means[1:]).astype(F),
    )
    return SampledPixels(pixels, pixel_pairs.pair_of_sample)


def within(parts: Sequence[ObjectPixels], tile: Tile, margin: int) -> ObjectPixels:
    """Those of the pairs in `parts` that lie within a tile or less than `margin` pixels beside it."""
    near = []
    for part in parts:
        inside = is_within(part, tile, margin)
        near.append(part if inside.all() else part.take(np.flatnonzero(inside)))
    return joined(near)


def is_within(pixels: ObjectPixels, tile: Tile, margin: int = 0) -> NDArray[np.bool_]:
    """(G,) Does each pair lie in a tile, or less than `margin` pixels beside it?"""
    across, down = pixels.x - (tile.x - margin), pixels.y - (tile.y - margin)
    inside = (across >= 0) & (across < tile.width + 2 * margin)
    return np.asarray(inside & (down >= 0) & (down < tile.height + 2 * margin))
