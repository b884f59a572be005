"""Accidents of workers, schedulers and clients: no picture is lost or half, and all are the same bytes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

COUNT = 12
SWEEP = ["sweep", "s.yaml", "-D", f"materials.clay.exponent=1:100:{COUNT}", "--no-cache",
         "-D", "film={width: 320, height: 240, samples: 4}"]  # fmt: skip


class Client:
    """A sweep in a process of its own."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "illumcli", *SWEEP, *words],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip

    def wait_for(self, count: int, seconds: float = 120) -> None:
        """Until so many pictures are there."""
        until = time.monotonic() + seconds
        while len(pictures(self.folder)) < count:
            assert time.monotonic() < until, self.process.poll()
            assert self.process.poll() is None, self.process.communicate()
            time.sleep(0.02)

    def finish(self, code: int = 0, seconds: float = 240) -> str:
        """The errors that it printed."""
        errors = self.process.communicate(timeout=seconds)[1]
        assert self.process.returncode == code, errors
        return errors


def pictures(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.glob("s-*.png"))}


@pytest.fixture
def expected(scene):
    Client(scene.parent).finish()
    found = pictures(scene.parent)
    assert len(found) == COUNT
    for name in found:
        (scene.parent / name).unlink()
    return found


def clean(folder, expected):
    """True if the folder holds all pictures and nothing that was left."""
    return pictures(folder) == expected and sorted(os.listdir(folder)) == sorted(
        [*expected, "meshes", "s.yaml", "t.png"]
    )


def kill(process):
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.parametrize("times", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_killed_workers_are_replaced_and_nothing_is_lost(scene, expected, machines, times):
    for _ in range(2):
        machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    for number in range(times):
        client.wait_for(min(1 + number, COUNT - 1))
        kill(machines.workers[-1])
        machines.start_worker()
        if client.process.poll() is not None:
            break
    client.finish()
    assert clean(scene.parent, expected)


def test_a_scheduler_that_is_started_again_gets_the_rest(scene, expected, machines):
    machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    client.wait_for(2)
    kill(machines.scheduler)
    kill(machines.workers[0])
    time.sleep(1)
    machines.start_scheduler()
    machines.start_worker()
    client.finish()
    assert clean(scene.parent, expected)


@pytest.mark.parametrize("cluster", ["local:2", "scheduler"])
def test_an_interrupted_client_leaves_whole_pictures_and_goes_on(scene, expected, machines, cluster):
    if cluster == "scheduler":
        machines.start_worker()
        cluster = machines.address
    client = Client(scene.parent, "--cluster", cluster)
    client.wait_for(2)
    os.killpg(client.process.pid, signal.SIGINT)
    errors = client.finish(-signal.SIGINT, 60)
    assert "Traceback" not in errors
    found = pictures(scene.parent)
    assert len(found) >= 2
    assert all(expected[name] == content for name, content in found.items())
    again = Client(scene.parent, "--cluster", cluster)
    assert again.finish().count("kept, its content is the same") >= len(found)
    assert clean(scene.parent, expected)


def test_a_worker_that_stands_still_delays_its_own_pieces_only(scene, expected, machines):
    for _ in range(2):
        machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    client.wait_for(2)
    os.killpg(machines.workers[0].pid, signal.SIGSTOP)
    client.wait_for(COUNT - 4)
    os.killpg(machines.workers[0].pid, signal.SIGCONT)
    client.finish()
    assert clean(scene.parent, expected)


def test_workers_that_die_of_a_variant_are_told_with_its_name(scene, machines):
    limit = ["prlimit", "--as=700000000"]  # too little for the pictures, enough to start
    machines.start_worker(limit)
    client = Client(
        scene.parent, "--cluster", machines.address, "-D", "film.width=9000", "-D", "film.height=9000"
    )
    errors = client.finish(4)
    assert "exponent 1: " in errors


def test_a_full_disk_of_a_worker_without_a_shared_folder(scene, expected, machines):
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    small = 'mount -t tmpfs none "$0" && mount -t tmpfs -o size=60k none "$1" && shift && exec "$@"'
    place = machines.folder / "worker0"
    place.mkdir()
    machines.start_worker(["unshare", "--mount", "sh", "-c", small, str(scene.parent), str(place)])
    machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    client.finish()
    assert clean(scene.parent, expected)
