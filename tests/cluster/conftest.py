"""A scheduler and workers on this machine, some of which do not see the client's files."""

from __future__ import annotations

import os
import shutil
import subprocess
from contextlib import ExitStack

import pytest

from cluster.machines import COUNT, Client, Machines, pictures
from cluster.network import Network

pytest.importorskip("distributed", reason="needs Dask's distributed")

SCENE = """
version: 1
film: {width: 64, height: 48, samples: 2}
ambient: 0.3
obscurance: {samples: 4}
materials:
  clay: {model: blinn_phong, diffuse: {texture: t.png}, specular: 0.3}
objects:
  - {name: ball, mesh: {shape: sphere}, material: clay}
  - {mesh: {file: meshes/floor.obj}, transform: {translate: [0, -1, 0]}}
lights: [{light: point, name: key, position: [3, 4, 5], intensity: 30}]
"""
FLOOR = "v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\n"


@pytest.fixture
def scene(tmp_path):
    """A scene of several files, in a folder of its own."""
    from illumcli.images.writer import ImageWriter

    folder = tmp_path / "client"
    (folder / "meshes").mkdir(parents=True)
    (folder / "s.yaml").write_text(SCENE)
    (folder / "meshes" / "floor.obj").write_text(FLOOR)
    import numpy as np

    with ImageWriter(folder / "t.png", 2, 2, dict.fromkeys("RGB", "uint8")) as writer:
        writer.write_band(0, np.array([[[200, 90, 40], [90, 200, 40]]] * 2, np.uint8))
    return folder / "s.yaml"


@pytest.fixture
def machines(tmp_path):
    made = Machines(tmp_path)
    yield made
    made.stop()


@pytest.fixture
def hosts(tmp_path):
    """Makes machines of so many hosts in network namespaces."""
    if os.geteuid() != 0:
        pytest.skip("only root can make network namespaces")
    if shutil.which("ip") is None:
        pytest.skip("network namespaces need the command ip, of iproute2")
    with ExitStack() as stack:

        def make(count: int, **environment: str) -> Machines:
            try:
                network = Network(count)
            except subprocess.CalledProcessError as error:
                pytest.skip(f"no network namespaces here: {error.stderr.strip()}")
            stack.callback(network.remove)
            made = Machines(tmp_path, network, **environment)
            stack.callback(made.stop)
            return made

        yield make


@pytest.fixture
def expected(scene):
    """The pictures as one process renders them."""
    Client(scene.parent).finish()
    found = pictures(scene.parent)
    assert len(found) == COUNT
    for name in found:
        (scene.parent / name).unlink()
    return found
