"""Border texels go on beyond smooth seams, and stay at hard edges."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.atlas.texels import texels_of
from illumcli.atlas.triangles import TextureSize
from illumcli.baking.inputs import prepare_bake
from illumcli.baking.seams import neighbours
from illumcli.baking.settings import BakeJob, BakeSettings
from illumcli.baking.texel_points import texel_points

SIZE = TextureSize(32, 32)

# two squares that meet at x = 1, the right one raised by an angle, with charts apart
SHEET = """\
v 0 0 0
v 1 0 0
v 1 0 -1
v 0 0 -1
v {x} {y} 0
v {x} {y} -1
vt 0.1 0.1
vt 0.4 0.1
vt 0.4 0.4
vt 0.1 0.4
vt 0.6 0.6
vt 0.9 0.6
vt 0.9 0.9
vt 0.6 0.9
f 1/1 2/2 3/3 4/4
f 2/5 5/6 6/7 3/8
"""


def places(tmp_path, degrees):
    """Texels of the border beyond x = 1 of the left chart: where they should be, and are, without units."""
    angle = np.radians(degrees)
    path = tmp_path / "sheet.obj"
    path.write_text(SHEET.format(x=1 + np.cos(angle), y=np.sin(angle)))
    work = prepare_bake(BakeJob(path, (tmp_path / "a.png",), BakeSettings(texture=(32, 32))))
    texels = texel_points(work.surfaces, work.slots, SIZE, {}, 1)
    texture = texels.textures[0]
    border = texels_of(texture.triangles).border
    rest = slice(len(texture.texel) - len(border.texel), None)
    space = work.surfaces.geometry.render_space
    position = space.to_world(texels.points.position[rest].astype(float))
    u, v = border.x / 32, 1 - border.y / 32
    beyond = (u > 0.4) & (u < 0.45) & (v > 0.12) & (v < 0.38)
    assert beyond.sum() > 5
    return (u[beyond] - 0.1) / 0.3, (v[beyond] - 0.1) / 0.3, position[beyond], angle


@pytest.mark.parametrize("degrees", [0, 20])
def test_they_go_on_over_a_smooth_edge_by_unfolding(tmp_path, degrees):
    u, v, position, angle = places(tmp_path, degrees)
    expected = np.stack([1 + (u - 1) * np.cos(angle), (u - 1) * np.sin(angle), -v], axis=1)
    np.testing.assert_allclose(position, expected, atol=0.01)


def test_they_stay_at_a_hard_edge(tmp_path):
    _, v, position, _ = places(tmp_path, 80)
    np.testing.assert_allclose(position, np.stack([0 * v + 1, 0 * v, -v], axis=1), atol=0.02)


def test_triangles_across_edges_know_each_other():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    # the second triangle over copies of vertices, and a third one turned round
    vertices = np.concatenate([square, square])
    across = neighbours(vertices, np.array([[0, 1, 2], [4, 6, 7], [0, 1, 3]], np.int32))
    assert across.triangle.tolist() == [[-1, -1, 1], [0, -1, -1], [-1, -1, -1]]
    assert across.opposite[0, 2] == 2
    assert across.opposite[1, 0] == 1
