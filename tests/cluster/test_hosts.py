"""Several hosts, in network namespaces of this machine, whose workers do not see the client's folder."""

from __future__ import annotations

import subprocess
import time

import pytest

from cluster.machines import COUNT, Client, is_clean

TURNS = [0, *(pytest.param(turn, marks=pytest.mark.slow) for turn in range(1, 10))]
SHORT = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__TCP": "15s"}
"""How soon a cut is noticed; 30 s by default."""


def sweep(machines, scene):
    return Client(scene.parent, "--cluster", machines.address, before=machines.at_hub)


def check(machines, scene, expected, again=0):
    renders = machines.renders()
    print(dict(renders))
    assert is_clean(scene.parent, expected)
    assert renders["began"] <= COUNT + again


def test_three_hosts_without_a_shared_folder_render_the_same_bytes(scene, expected, hosts):
    machines = hosts(3)
    for _ in range(3):
        machines.start_hidden_worker()
    sweep(machines, scene).finish()
    check(machines, scene, expected)
    assert list(machines.folder.glob("worker*/dask-scratch-space/*/illum-*")) == []


def test_namespaces_are_removed_also_after_a_failure(hosts):
    machines = hosts(1)
    network = machines.network
    held = subprocess.Popen([*network.inside(network.hosts[0]), "sleep", "600"])
    machines.stop()
    network.remove()
    assert held.wait(10) == -9
    assert network.hub.split("-hub")[0] not in subprocess.check_output(["ip", "netns"], text=True)


@pytest.mark.parametrize(
    ("seconds", "turn"),
    [
        (3, 0),
        *(pytest.param(seconds, turn, marks=pytest.mark.slow) for seconds in (3, 30) for turn in range(10)),
    ],
)
def test_a_network_that_is_cut_for_a_while(scene, expected, hosts, seconds, turn):
    machines = hosts(2)
    for _ in range(2):
        machines.start_hidden_worker(ILLUM_TEST_DELAY="1")
    client = sweep(machines, scene)
    client.wait_for(3)
    time.sleep(0.2 * turn)
    machines.network.set_link(0, "down")
    time.sleep(seconds)
    machines.network.set_link(0, "up")
    client.finish()
    check(machines, scene, expected, again=0 if seconds < 15 else 2)
