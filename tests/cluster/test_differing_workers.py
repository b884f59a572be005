"""Workers of another version or processor class get no work, unless `--mixed-workers` allows them."""

from __future__ import annotations

import os
import signal

from cluster.machines import Client, is_clean, pictures


def test_a_worker_that_differs_is_refused_with_what_differs(scene, machines):
    machines.start_worker(ILLUM_TEST_FACTS="numpy=1.0,instructions=NEON")
    errors = Client(scene.parent, "--cluster", machines.address).finish(2)
    assert "worker tcp://127.0.0.1:" in errors
    assert "has numpy 1.0, not" in errors
    assert "has instructions NEON, not" in errors
    assert "--mixed-workers" in errors
    assert pictures(scene.parent) == {}


def test_mixed_workers_are_allowed(scene, expected, machines):
    machines.start_worker(ILLUM_TEST_FACTS="numpy=1.0,instructions=NEON")
    Client(scene.parent, "--cluster", machines.address, "--mixed-workers").finish()
    assert is_clean(scene.parent, expected)


def test_a_worker_that_differs_and_comes_later_gets_no_work(scene, expected, machines):
    machines.start_worker()
    client = Client(scene.parent, "--cluster", machines.address)
    client.wait_for(2)
    os.killpg(machines.workers[0].pid, signal.SIGSTOP)  # until the other has been asked
    machines.start_worker(ILLUM_TEST_FACTS="illum=0.0.1")
    told = client.read_until("it gets no work")
    assert "has illum 0.0.1, not" in told
    os.killpg(machines.workers[0].pid, signal.SIGCONT)
    assert "it gets no work" not in client.finish()
    assert is_clean(scene.parent, expected)
