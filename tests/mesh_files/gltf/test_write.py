"""GLB files written: what glTF asks of their numbers."""

from __future__ import annotations

import numpy as np

from illumcli.mesh_files.gltf.write import unit_rows


def test_unit_rows_have_length_one_and_zero_points_up():
    rows = unit_rows(np.array([[3.0, 0, 4], [0, 0, 0]]))
    np.testing.assert_allclose(rows, [[0.6, 0, 0.8], [0, 0, 1]])
