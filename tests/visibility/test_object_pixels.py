"""Pixels of objects: means over the samples that see one object, and back."""

from __future__ import annotations

import numpy as np

from illumcli.film.tiles import Samples
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.object_pixels import object_pixels, pixel_pairs


def sampled(sample, objects, w, baked=None):
    """Two pixels of four samples each, some of which see objects."""
    count = len(sample)
    samples = Samples(np.array([7, 8]), np.array([3, 3]), np.zeros((8, 2)), 4)
    hits = Hits(np.array(sample, np.int32), *(np.zeros(count),) * 3)
    place = np.column_stack([np.arange(count), np.zeros(count), np.ones(count)])
    surface = SurfaceInteraction(place, place.astype(np.float32), np.ones(count), np.zeros(count, np.bool_))
    over = Hemispheres(place.astype(np.float32), place.astype(np.float32))
    pairs = pixel_pairs(samples, hits, np.array(objects, np.uint32), baked)
    return object_pixels(samples, pairs, over, surface, np.array(w, np.float32))


def test_a_pixel_has_a_mean_for_each_object():
    means = sampled([0, 1, 2, 3, 5, 6], [2, 1, 2, 1, 1, 1], [0, 0.5, 1, 1, 0.25, 0.75])
    pairs = means.pixels
    assert pairs.x.tolist() == [7, 7, 8]
    assert pairs.y.tolist() == [3, 3, 3]
    assert pairs.object.tolist() == [1, 2, 1]
    assert pairs.share.tolist() == [0.5, 0.5, 0.5]
    assert pairs.hidden.tolist() == [0.25, 0.5, 0.5]
    assert pairs.features[3].tolist() == [2, 1, 4.5]
    assert means.to_samples(np.zeros(6), np.array([10, 20, 30])).tolist() == [20, 10, 20, 10, 30, 30]


def test_baked_samples_take_no_part():
    baked = np.array([np.nan, 0.5, np.nan], np.float32)
    means = sampled([0, 1, 2], [1, 2, 1], [0.25, 0.5, 0.75], baked)
    assert means.pixels.object.tolist() == [1]
    assert means.pixels.hidden.tolist() == [0.5]
    assert means.to_samples(np.array([0.25, 0.5, 0.75]), np.array([9.0])).tolist() == [9, 0.5, 9]
