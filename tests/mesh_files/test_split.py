"""Vertices split where their corners differ."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.mesh_files.split import split_vertices


@pytest.mark.parametrize("seed", range(20))
def test_each_vertex_has_a_copy_for_every_further_combination(seed: int) -> None:
    random = np.random.default_rng(seed)
    count, corners = 9, random.integers(0, 8, 40)  # vertex 8 has no corner
    tables = [random.integers(0, 1 + seed % 3, (40, 2)), random.integers(0, 2, (40, 1)) / 2]
    split = split_vertices(corners, count, tables)
    rows = np.column_stack([corners, *tables])
    assert len(split.source) == len(np.unique(rows, axis=0)) + 1
    np.testing.assert_array_equal(split.source[split.of_corner], corners)
    np.testing.assert_array_equal(split.source[:count], np.arange(count))
    assert split.corner[8] == -1

    # the corner that a vertex names has its row, and the first corner of a vertex keeps its number
    used = split.corner >= 0
    np.testing.assert_array_equal(rows[split.corner[used], 0], split.source[used])
    np.testing.assert_array_equal(rows[split.corner[split.of_corner]], rows)
    first = [int(np.argmax(corners == vertex)) for vertex in range(8)]
    np.testing.assert_array_equal(split.of_corner[first], np.arange(8))

    # copies are in the order of their first corners
    copies = split.of_corner[split.of_corner >= count]
    np.testing.assert_array_equal(list(dict.fromkeys(copies.tolist())), np.arange(count, len(split.source)))


def test_nothing_to_split() -> None:
    split = split_vertices(np.array([0, 1, 2, 2, 1, 3]), 4, [np.zeros((6, 3))])
    assert split.of_corner.tolist() == [0, 1, 2, 2, 1, 3]
    assert split.corner.tolist() == [0, 1, 2, 5]
    columns = split.columns({"w": np.arange(4.0)}, {"w": np.array([9.0, 8, 7, 7, 8, 6])})
    assert columns["w"].tolist() == [9, 8, 7, 6]
