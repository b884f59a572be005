"""Pixels of objects: means over the samples that see one object, and back."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.film.tiles import Samples
from illumcli.rays.interaction import Hits, SurfaceInteraction
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.object_pixels import FittedPixels, ObjectPixels, object_pixels, pixel_pairs


def sampled(sample, objects, w, baked=None, read=None):
    """Two pixels of four samples each, some of which see objects."""
    count = len(sample)
    hits = Hits(np.array(sample, np.int32), *(np.zeros(count),) * 4)
    place = np.column_stack([np.arange(count), np.zeros(count), np.ones(count)])
    surface = SurfaceInteraction(place, place.astype(np.float32), np.ones(count), np.zeros(count, np.bool_))
    over = Hemispheres(place.astype(np.float32), place.astype(np.float32))
    pairs = pixel_pairs(SAMPLES, hits, np.array(objects, np.uint32), read, baked)
    return object_pixels(SAMPLES, pairs, over, surface, np.array(w, np.float32))


SAMPLES = Samples(np.array([7, 8]), np.array([3, 3]), np.zeros((8, 2)), 4)


def fitted(x, y, objects, w):
    numbers = (np.array(each, np.int32) for each in (x, y, objects))
    pixels = ObjectPixels(*numbers, *(np.ones(len(x), np.float32),) * 2, np.zeros((6, len(x)), np.float32))
    return FittedPixels.of(pixels, np.array(w, np.float32))


def at(pairs, sample, objects):
    return pairs.at(SAMPLES, np.array(sample, np.int32), np.array(objects, np.uint32)).tolist()


def test_a_pixel_has_a_mean_for_each_object():
    pairs = sampled([0, 1, 2, 3, 5, 6], [2, 1, 2, 1, 1, 1], [0, 0.5, 1, 1, 0.25, 0.75])
    assert pairs.x.tolist() == [7, 7, 8]
    assert pairs.y.tolist() == [3, 3, 3]
    assert pairs.object.tolist() == [1, 2, 1]
    assert pairs.share.tolist() == [0.5, 0.5, 0.5]
    assert pairs.hidden.tolist() == [0.25, 0.5, 0.5]
    assert pairs.features[3].tolist() == [2, 1, 4.5]


def test_baked_samples_take_no_part():
    baked = np.array([np.nan, 0.5, np.nan], np.float32)
    pairs = sampled([0, 1, 2], [1, 2, 1], [0.25, 0.5, 0.75], baked)
    assert pairs.object.tolist() == [1]
    assert pairs.hidden.tolist() == [0.5]


def test_hits_that_are_not_read_take_no_part():
    pairs = sampled([0, 1, 5, 6], [1, 1, 1, 2], [0.25, np.nan, np.nan, 0.5], read=np.array([0, 3]))
    assert pairs.x.tolist() == [7, 8]
    assert pairs.object.tolist() == [1, 2]
    assert pairs.hidden.tolist() == [0.75, 0.5]


def test_hits_take_the_value_of_their_object_in_their_pixel():
    pairs = fitted([8, 7, 7, 7], [3, 3, 3, 3], [1, 4, 1, 2], [0.9, 0.4, 0.1, 0.2])
    assert at(pairs, [0, 1, 2, 3, 5, 6], [2, 1, 4, 1, 1, 1]) == pytest.approx([0.2, 0.1, 0.4, 0.1, 0.9, 0.9])


def test_hits_without_a_pair_take_another_of_their_pixel_or_are_open():
    pairs = fitted([7, 7, 9], [3, 3, 3], [1, 2, 1], [0.1, 0.2, 0.3])
    assert at(pairs, [0, 1, 4], [2, 3, 1]) == pytest.approx([0.2, 0.1, 1])
    assert at(fitted([], [], [], []), [0, 4], [1, 1]) == [1, 1]


def test_pairs_of_several_tiles_are_in_the_order_of_the_film():
    parts = [fitted([9, 70000], [2, 0], [1, 1], [0.1, 0.2]), fitted([3, 3], [2, 2], [5, 4], [0.3, 0.4])]
    whole = FittedPixels.joined(parts)
    assert whole.x.tolist() == [70000, 3, 3, 9]
    assert whole.object.tolist() == [1, 4, 5, 1]
    assert whole.w.tolist() == pytest.approx([0.2, 0.4, 0.3, 0.1])
