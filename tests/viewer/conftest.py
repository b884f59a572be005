"""A small scene, and the server of its page."""

from __future__ import annotations

import threading
from contextlib import contextmanager

import pytest

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


@contextmanager
def served(path):
    """The server of a scene's page, which runs in a thread."""
    pytest.importorskip("websockets", reason="needs websockets")
    from illumcli.viewer.pictures import Renderer
    from illumcli.viewer.server import Viewer
    from illumcli.viewer.session import Session

    viewer = Viewer(lambda send: Session(Renderer(path), send))
    thread = threading.Thread(target=viewer.run)
    thread.start()
    try:
        yield viewer
    finally:
        viewer.stop()
        thread.join()


@pytest.fixture
def viewer(scene):
    """The server of the scene's page."""
    with served(scene) as viewer:
        yield viewer


@pytest.fixture
def another_viewer(scene):
    """A second server of the same scene."""
    with served(scene) as viewer:
        yield viewer
