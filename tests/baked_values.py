"""Baked values of two squares, for tests of files."""

from __future__ import annotations

import numpy as np

from illumcli.visibility.baked import Baked

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
ABOUT = {"content": "abc", "vertices": {"a": 4, "b": 4}, "meshes": {"a": "hash a", "b": "hash b"}}


def baked(count=4, bent=False, **about):
    w = np.linspace(0, 1, count, dtype=np.float32)
    channels = {"obscurance": w, "standard_error": w / 100}
    if bent:
        channels["bent_normal"] = np.tile(np.float32([0, 0, 1]), (count, 1))
    return Baked(channels, about)
