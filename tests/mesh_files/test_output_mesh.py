"""Meshes for the writers: precision and names."""

from __future__ import annotations

import numpy as np

from illumcli.mesh_files.output_mesh import fits_single, free_name

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)


def test_single_precision_is_enough_near_the_origin_alone():
    assert fits_single(SQUARE)
    assert not fits_single(SQUARE + 1e6 + 0.3)
    assert fits_single(np.empty((0, 3)))


def test_a_name_that_is_taken_gets_underscores():
    assert free_name("heat", {"uv": 1}) == "heat"
    assert free_name("heat", ["heat", "heat_"]) == "heat__"
