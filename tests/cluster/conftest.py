"""A scheduler and workers on this machine, some of which do not see the client's files."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

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


class Machines:
    """Processes of a scheduler and its workers; all end with the test."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.folder = folder
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self.start_scheduler()

    def start_scheduler(self):
        words = ["--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        self.scheduler = self._started("dask_scheduler", words, "scheduler")
        until = time.monotonic() + 60
        while time.monotonic() < until:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return self.scheduler
            time.sleep(0.1)
        raise RuntimeError("no scheduler")

    def start_worker(self, before=()):
        """A worker in a folder of its own; `before` are the words of a command that starts it."""
        place = self.folder / f"worker{len(self.workers)}"
        place.mkdir(exist_ok=True)
        words = [self.address, "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1",
                 "--local-directory", str(place)]  # fmt: skip
        self.workers.append(self._started("dask_worker", words, place.name, before))
        return self.workers[-1]

    def _started(self, module, words, name, before=()):
        environment = {**os.environ, "ILLUM_CACHE": str(self.folder / f"cache-{name}")}
        with (self.folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen(
                [*before, sys.executable, "-m", f"distributed.cli.{module}", *words],
                stdout=log, stderr=log, cwd=self.folder, env=environment, start_new_session=True,
            )  # fmt: skip

    def stop(self):
        for process in (*self.workers, self.scheduler):
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            process.wait()


@pytest.fixture
def machines(tmp_path):
    made = Machines(tmp_path)
    yield made
    made.stop()
