"""FLIP: the published measure."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.images import openimageio
from illumcli.images.flip import flip


@pytest.mark.parametrize("encoded", [False, True])
def test_flip_is_nothing_for_equal_and_nearly_one_for_opposite(encoded):
    black, white = np.zeros((24, 24, 3), np.float32), np.ones((24, 24, 3), np.float32)
    mean, errors = flip(black, black, encoded)
    assert mean == 0
    assert errors.shape == (24, 24)
    assert flip(black, white, encoded)[0] == pytest.approx(0.9674, abs=2e-4)


def test_flip_is_the_published_measure():
    """0.40743646 is what the authors' own tool, version 1.7, gives for the same two images (LDR, sRGB)."""
    grey = np.indices((20, 30)).sum(axis=0)[..., None].repeat(3, -1).astype(np.float32) / 50
    mean, _ = flip(grey, np.clip(grey * np.array([1, 0.8, 0.9], np.float32), 0, 1), encoded=True)
    assert mean == pytest.approx(0.40743646, rel=1e-5)


def test_flip_that_the_library_refuses_is_no_number(monkeypatch):
    class Refusal:
        has_error, geterror = True, staticmethod(lambda: "out of sorts")

    monkeypatch.setattr(openimageio.oiio.ImageBufAlgo, "FLIP_diff", lambda *words, **more: Refusal())
    black = np.zeros((8, 8, 3), np.float32)
    with pytest.raises(RuntimeError, match="out of sorts"):
        flip(black, black)
