"""Means over those samples of a pixel that hit one object, for the reconstruction of w, and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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
    if not parts:
        return nothing()
    return ObjectPixels(
        np.concatenate([part.x for part in parts]),
        np.concatenate([part.y for part in parts]),
        np.concatenate([part.object for part in parts]),
        np.concatenate([part.share for part in parts]),
        np.concatenate([part.hidden for part in parts]),
        np.concatenate([part.features for part in parts], axis=1),
    )


def nothing() -> ObjectPixels:
    """No pairs."""
    number = np.zeros(0, np.int32)
    return ObjectPixels(number, number, number, np.zeros(0, F), np.zeros(0, F), np.zeros((6, 0), F))


class FittedPixels(Record):
    """w of G pairs of a pixel and an object in it, row by row of the film, by object within a pixel."""

    x: NDArray[np.int32]  # (G,) column of the film
    y: NDArray[np.int32]  # (G,) row
    object: NDArray[np.int32]  # (G,)
    w: NDArray[np.float32]  # (G,)

    @classmethod
    def of(cls, pixels: ObjectPixels, w: NDArray[np.float32]) -> FittedPixels:
        """Those of some pairs, in any order."""
        return cls(pixels.x, pixels.y, pixels.object, w).in_order()

    @classmethod
    def joined(cls, parts: Sequence[FittedPixels]) -> FittedPixels:
        """Those of several tiles."""
        columns = ([getattr(part, name) for part in parts] for name in ("x", "y", "object", "w"))
        return cls(*map(np.concatenate, columns)).in_order()

    def in_order(self) -> FittedPixels:
        """The same pairs, row by row."""
        number = _number(self.x, self.y)
        same = np.diff(number) == 0
        if (np.diff(number) >= 0).all() and (np.diff(self.object)[same] > 0).all():
            return self
        order = np.lexsort((self.object, number))
        x, y, objects = (each.take(order) for each in (self.x, self.y, self.object))
        return FittedPixels(x, y, objects, self.w.take(order))

    def at(
        self, samples: Samples, sample: NDArray[np.int32], objects: NDArray[np.uint32]
    ) -> NDArray[np.float32]:
        """(M,) float32 w of the pair of each hit.

        A hit whose object has no pair in its pixel takes the value of another object there, 1 if there is
        none.

        Parameters
        ----------
        sample : (M,) int32
            The sample of each hit.
        objects : (M,) uint32
            The object of each hit.
        """
        if not len(self.w):
            return np.ones(len(sample), F)
        number = _number(samples.x, samples.y)
        own = _number(self.x, self.y)
        first = np.searchsorted(own, number)
        pair = np.minimum(first, len(own) - 1)
        is_there = own.take(pair) == number
        pixel = sample // samples.per_pixel if samples.per_pixel > 1 else sample
        pair, is_there = pair.take(pixel), is_there.take(pixel)
        w = np.where(is_there, self.w.take(pair), F(1))

        # The other pairs of pixels that see several objects.
        search = np.flatnonzero(is_there & (self.object.take(pair) != objects))
        while len(search):
            following = np.minimum(pair[search] + 1, len(own) - 1)
            more = (following > pair[search]) & (own[following] == number[pixel[search]])
            search, following = search[more], following[more]
            pair[search] = following
            is_same = self.object[following] == objects[search]
            w[search[is_same]] = self.w[following[is_same]]
            search = search[~is_same]
        return w


def _number(x: NDArray[Any], y: NDArray[Any]) -> NDArray[np.int64]:
    """Numbers of pixels that ascend row by row, whatever the size of the film."""
    return np.asarray((y.astype(np.int64) << 32) | x)


def obscurance_of_samples(
    samples: Samples,
    hits: Hits,
    object_id: NDArray[np.uint32],
    fitted_obscurance: FittedPixels,
    baked_obscurance: Floats | None = None,
) -> NDArray[np.float32]:
    """(M,) w of every hit: that of its object in its pixel, or baked.

    Parameters
    ----------
    baked_obscurance : (M,) float32, optional
        NaN on meshes that have no baked values.
    """
    w = fitted_obscurance.at(samples, hits.sample, object_id)
    if baked_obscurance is None:
        return w
    return np.where(np.isnan(baked_obscurance), w, baked_obscurance.astype(F))


class PixelPairs(Record):
    """The G pairs of a pixel and an object in it, and the K samples of each, in the order of the pairs."""

    samples: NDArray[np.int64]  # (K,) those whose w is traced
    first: NDArray[np.int64]  # (G,) index of each pair's first one in `samples`
    pixel: NDArray[np.int64]  # (G,) number within the tile
    object: NDArray[np.int32]  # (G,)


def pixel_pairs(
    samples: Samples,
    hits: Hits,
    object_id: NDArray[np.uint32],
    read_hits: NDArray[np.int64] | None,
    baked_obscurance: Floats | None = None,
) -> PixelPairs:
    """The pairs of a tile's hits, pixel by pixel.

    Parameters
    ----------
    read_hits : (K,) int64, optional
        The hits that are in a pair, if not all are.
    baked_obscurance : (M,) float32, optional
        NaN on meshes that have no baked values; hits on other meshes are in no pair.
    """
    traced = np.arange(len(hits.sample)) if read_hits is None else read_hits
    if baked_obscurance is not None:
        traced = traced[np.isnan(baked_obscurance.take(traced))]

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
    return PixelPairs(traced, first, pixel[first], objects[first].astype(np.int32))


def object_pixels(
    samples: Samples,
    pixel_pairs: PixelPairs,
    hemispheres: Hemispheres,
    interaction: SurfaceInteraction,
    raw_obscurance: Floats,
) -> ObjectPixels:
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
    return ObjectPixels(
        samples.x.take(pixel_pairs.pixel).astype(np.int32),
        samples.y.take(pixel_pairs.pixel).astype(np.int32),
        pixel_pairs.object,
        (count / samples.per_pixel).astype(F),
        means[0].astype(F),
        np.stack(means[1:]).astype(F),
    )


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
