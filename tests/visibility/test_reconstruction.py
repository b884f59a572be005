"""Reconstruction of w: exact where it is linear or open, objects apart, the same for any tiles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from illumcli.visibility.object_pixels import ObjectPixels, joined
from illumcli.visibility.reconstruction import MARGIN, reconstructed, window_sums


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def surface(rng, objects: int = 1, side: int = 90) -> ObjectPixels:
    """A picture of bumpy surfaces, object by object in blobs, and noisy w."""
    y, x = (each.ravel() for each in np.mgrid[:side, :side].astype(np.int32))
    owner = (np.sin(x / 9) + np.cos(y / 7 + x / 23) + 2) * objects / 4
    n = np.stack([np.sin(x / 11), np.cos(y / 13), np.sin((x + y) / 17)])
    position = np.stack([x / side, y / side, np.sin(x / 30) * np.cos(y / 25)])
    w = 0.6 + 0.3 * np.sin(x / 20) * np.cos(y / 15)
    hidden = np.clip(1 - w + rng.normal(0, 0.1, len(x)), 0, 1)
    features = np.concatenate([n, position]).astype(np.float32)
    share = np.ones(len(x), np.float32)
    return ObjectPixels(x, y, owner.astype(np.int32), share, hidden.astype(np.float32), features)


def everything(pixels: ObjectPixels) -> np.ndarray:
    return reconstructed(pixels, np.ones(len(pixels.x), np.bool_))


@pytest.mark.parametrize("radius", [1, 2])
def test_window_sums_are_sums_over_windows(rng, radius):
    planes = rng.normal(size=(2, 30, 27))
    windows = np.lib.stride_tricks.sliding_window_view(planes, (2 * radius + 1,) * 2, axis=(1, 2))
    np.testing.assert_allclose(window_sums(planes, radius), windows.sum(axis=(3, 4)), rtol=0, atol=1e-12)


def test_what_is_linear_in_normal_and_position_is_kept(rng):
    pixels = surface(rng)
    slopes = np.array([0.05, -0.1, 0.08, 0.2, -0.1, 0.05], np.float32)
    exact = 0.4 + slopes @ pixels.features
    assert exact.min() > 0
    assert exact.max() < 1
    np.testing.assert_allclose(everything(replace(pixels, hidden=exact)), 1 - exact, atol=5e-5)


def test_open_surroundings_stay_exactly_open(rng):
    pixels = surface(rng)
    hidden = np.where(pixels.x < 30, pixels.hidden, 0).astype(np.float32)
    w = everything(replace(pixels, hidden=hidden))
    assert (w[pixels.x >= 30 + MARGIN] == 1).all()
    assert (w[pixels.x < 30] < 1).mean() > 0.9


def test_noise_is_reduced(rng):
    pixels = surface(rng)
    exact = 0.6 + 0.3 * np.sin(pixels.x / 20) * np.cos(pixels.y / 15)
    raw, after = (
        float(np.sqrt(np.mean(np.square(w - exact)))) for w in (1 - pixels.hidden, everything(pixels))
    )
    assert after < raw / 4


@pytest.mark.parametrize("objects", [1, 3, 40])
def test_values_are_the_same_for_any_tiles(rng, objects):
    pixels = surface(rng, objects)
    whole, parts = everything(pixels), np.zeros(len(pixels.x), np.float32)
    for x, y, width, height in ((0, 0, 37, 90), (37, 0, 53, 21), (37, 21, 53, 69)):
        near = (pixels.x >= x - MARGIN) & (pixels.x < x + width + MARGIN)
        near &= (pixels.y >= y - MARGIN) & (pixels.y < y + height + MARGIN)
        inside = (pixels.x >= x) & (pixels.x < x + width) & (pixels.y >= y) & (pixels.y < y + height)
        parts[inside] = reconstructed(pixels.take(np.flatnonzero(near)), inside[near])
    np.testing.assert_array_equal(parts, whole)


def test_objects_do_not_mix(rng):
    pixels = surface(rng, 40)
    assert len(np.unique(pixels.object)) > 20
    together = everything(pixels)
    for number in np.unique(pixels.object):
        alone = pixels.take(np.flatnonzero(pixels.object == number))
        np.testing.assert_array_equal(everything(alone), together[pixels.object == number])


def test_pixels_that_two_objects_share_have_both(rng):
    back = surface(rng)
    front = replace(back.take(np.flatnonzero(back.x < 40)), object=back.object[back.x < 40] + 1)
    both = joined([back, replace(front, share=np.full(len(front.x), 0.5, np.float32))])
    np.testing.assert_array_equal(everything(both)[: len(back.x)], everything(back))


def test_nothing_seen_gives_nothing(rng):
    none = surface(rng).take(np.zeros(0, np.intp))
    assert everything(none).shape == (0,)
