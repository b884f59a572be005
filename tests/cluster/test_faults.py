"""Accidents of workers, schedulers and clients: no picture is lost or half, and all are the same bytes.

Only pictures that were in work at that moment are rendered again. Each fault is tried once, and nine times
more with `-m slow`.
"""

from __future__ import annotations

import os
import signal
import time

import pytest

from cluster.machines import COUNT, Client, is_clean, pictures

pytestmark = pytest.mark.parametrize(
    "turn", [0, *(pytest.param(turn, marks=pytest.mark.slow) for turn in range(1, 10))]
)
LITTLE_MEMORY = ["prlimit", "--as=500000000"]
"""Enough for a worker to start, too little for a large picture."""
LARGE = "film={width: 1000, height: 800, samples: 1}"


def kill(process):
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def check(machines, scene, expected, again=0, kept=0):
    """Assert that all pictures are there, and how many renders were begun more than once."""
    renders = machines.renders()
    print(dict(renders))
    assert is_clean(scene.parent, expected)
    assert renders["began"] - renders["kept"] <= COUNT + again
    assert renders["kept"] <= kept


def test_killed_workers_are_replaced_and_nothing_is_lost(scene, expected, machines, turn):
    for _ in range(2):
        machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    for number in (1, 4, 7):
        client.wait_for(number + turn % 3)
        kill(machines.workers[-1])
        machines.start_worker()
    client.finish()
    check(machines, scene, expected, again=3, kept=3)


@pytest.mark.parametrize("is_hidden", [False, True])
def test_workers_killed_while_they_write(scene, expected, machines, turn, is_hidden):
    if is_hidden and os.geteuid() != 0:
        pytest.skip("only root can hide a folder from a process")
    deaths = machines.folder / "deaths"
    deaths.mkdir()
    for number in range(2):
        (deaths / str(number)).touch()
        start = machines.start_hidden_worker if is_hidden else machines.start_worker
        start(ILLUM_TEST_DEATHS=str(deaths))
    Client(scene.parent, "--cluster", machines.address).finish()
    assert list(deaths.iterdir()) == []
    check(machines, scene, expected, again=2)


def test_a_scheduler_that_is_started_again_gets_the_rest(scene, expected, machines, turn):
    machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    client.wait_for(2 + turn % 3)
    kill(machines.scheduler)
    kill(machines.workers[0])
    time.sleep(1)
    machines.start_scheduler()
    machines.start_worker()
    assert client.finish().count("the scheduler is lost") == 1
    check(machines, scene, expected, again=1, kept=1)


@pytest.mark.parametrize("cluster", ["local:2", "scheduler"])
def test_an_interrupted_client_leaves_whole_pictures_and_goes_on(scene, expected, machines, turn, cluster):
    if cluster == "scheduler":
        machines.start_worker()
        cluster = machines.address
    client = Client(scene.parent, "--cluster", cluster)
    client.wait_for(2 + turn % 3)
    os.killpg(client.process.pid, signal.SIGINT)
    errors = client.finish(-signal.SIGINT, 60)
    assert "Traceback" not in errors
    found = pictures(scene.parent)
    assert len(found) >= 2
    assert all(expected[name] == content for name, content in found.items())
    again = Client(scene.parent, "--cluster", cluster)
    assert again.finish().count("kept, its content is the same") >= len(found)
    assert is_clean(scene.parent, expected)
    if cluster == machines.address:
        check(machines, scene, expected, kept=3)


def test_a_worker_that_stands_still_delays_its_own_pieces_only(scene, expected, machines, turn):
    for _ in range(2):
        machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    client.wait_for(2)
    os.killpg(machines.workers[0].pid, signal.SIGSTOP)
    client.wait_for(4)  # the other goes on; blocks that the scheduler gave to the first wait for it
    os.killpg(machines.workers[0].pid, signal.SIGCONT)
    client.finish()
    check(machines, scene, expected)


def test_a_slow_worker_gets_less(scene, expected, machines, turn):
    machines.start_worker(ILLUM_TEST_DELAY="4")
    machines.start_worker()
    Client(scene.parent, "--cluster", machines.address).finish()
    check(machines, scene, expected)


def test_a_variant_of_which_all_workers_die_is_named(scene, machines, turn):
    machines.start_worker(LITTLE_MEMORY)
    words = ["-D", "film.width=9000", "-D", "film.height=9000"]
    errors = Client(scene.parent, "--cluster", machines.address, *words).finish(4)
    assert "exponent 1: " in errors


def test_a_worker_with_little_memory_beside_another(scene, machines, turn):
    Client(scene.parent, "-D", LARGE).finish()
    expected = pictures(scene.parent)
    for name in expected:
        (scene.parent / name).unlink()
    machines.start_worker(LITTLE_MEMORY)
    machines.start_worker()
    Client(scene.parent, "-D", LARGE, "--cluster", machines.address).finish()
    check(machines, scene, expected, again=COUNT)


def test_a_full_disk_of_a_worker_without_a_shared_folder(scene, expected, machines, turn):
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    small = 'mount -t tmpfs none "$0" && mount -t tmpfs -o size=60k none "$1" && shift && exec "$@"'
    place = machines.folder / "worker0"
    place.mkdir()
    machines.start_worker(["unshare", "--mount", "sh", "-c", small, str(scene.parent), str(place)])
    machines.start_worker()
    Client(scene.parent, "--cluster", machines.address).finish()
    print(dict(machines.renders()))
    assert is_clean(scene.parent, expected)
