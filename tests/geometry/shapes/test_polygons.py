from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.geometry.shapes.polygons import Polygons

ROOF = {"vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], "faces": [[0, 1, 2, 3], [0, 2, 1]]}


def test_the_faces_come_out_as_written():
    mesh = Polygons.model_validate(ROOF).mesh()
    assert mesh.corners.tolist() == [0, 1, 2, 3, 0, 2, 1]
    assert mesh.starts.tolist() == [0, 4, 7]
    np.testing.assert_array_equal(mesh.vertices, ROOF["vertices"])
    assert mesh.normals is None


def test_normals_belong_to_vertices():
    normals = [[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 2]]
    mesh = Polygons.model_validate(ROOF | {"normals": normals}).mesh()
    np.testing.assert_array_equal(mesh.normals[mesh.corner_normals], np.array(normals)[mesh.corners])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"faces": [[0, 1, 2], [0, 1, 4]]}, r"faces\n.*face 1 names vertex 4, the last one is 3"),
        ({"faces": [[0, 1, -1]]}, "faces.0.2\n.*greater than or equal to 0"),
        ({"faces": [[0, 1]]}, "faces.0\n.*at least 3"),
        ({"faces": []}, "faces\n.*at least 1"),
        ({"normals": [[0, 0, 1]]}, "normals\n.*one per vertex, 4, there are 1"),
        ({"normals": [[0, 0, 1], [0, 0, 0], [0, 0, 1], [0, 0, 1]]}, "normal 1 is zero"),
        ({"vertices": [[0, 0], [1, 0, 0], [0, 1, 0]]}, "vertices.0"),
    ],
)
def test_faults_are_named(change, message):
    with pytest.raises(ValidationError, match=message):
        Polygons.model_validate(ROOF | change)
