"""A small scene, and the server of its page."""

from __future__ import annotations

import pytest

from viewing import served

SCENE = """version: 1
camera: {position: [0, 1.2, 4], target: [0, 0.6, 0], fov: 35}
film: {width: 96, height: 54, samples: 1, background: [0.1, 0.1, 0.1]}
ambient: 0.3
obscurance: {samples: 4, falloff: {falloff: smooth, max_distance: 2}}
materials:
  clay: {model: phong, diffuse: [0.6, 0.2, 0.1], specular: 0.2, exponent: 20}
  floor: {model: lambert, diffuse: 0.5}
objects:
  - {name: ball, mesh: {shape: sphere}, material: clay, transform: {fit: 1.4}}
  - {name: ground, mesh: {shape: disc, radius: 9}, material: floor}
lights:
  - {light: point, name: key, position: [-2, 4, 3], intensity: 20}
  - {light: point, name: fill, position: [3, 2, 2], intensity: [2, 3, 4]}
"""


@pytest.fixture
def scene(tmp_path):
    """The file of a scene that renders in no time."""
    path = tmp_path / "ball.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def viewer(tmp_path_factory):
    """The server of a page of such a scene, which stays as it is."""
    path = tmp_path_factory.mktemp("viewed") / "ball.yaml"
    path.write_text(SCENE)
    with served(path) as viewer:
        yield viewer


@pytest.fixture
def own_viewer(scene):
    """The server of the page of the test's own scene."""
    with served(scene) as viewer:
        yield viewer


@pytest.fixture
def another_viewer(scene):
    """A second server of the same scene."""
    with served(scene) as viewer:
        yield viewer
