"""Workers of another version or processor class are refused, or allowed by `--mixed-workers`."""

from __future__ import annotations

import pytest

from cluster.machines import Client, is_clean, pictures


@pytest.mark.parametrize("facts", ["numpy=1.0", "instructions=NEON"])
def test_a_worker_that_differs_is_refused_with_what_differs(scene, machines, facts):
    machines.start_worker(ILLUM_TEST_FACTS=facts)
    errors = Client(scene.parent, "--cluster", machines.address).finish(2)
    assert "worker tcp://127.0.0.1:" in errors
    assert f"has {facts.replace('=', ' ')}, this process" in errors
    assert "--mixed-workers" in errors
    assert pictures(scene.parent) == {}


def test_mixed_workers_are_allowed(scene, expected, machines):
    machines.start_worker(ILLUM_TEST_FACTS="numpy=1.0,instructions=NEON")
    Client(scene.parent, "--cluster", machines.address, "--mixed-workers").finish()
    assert is_clean(scene.parent, expected)


def test_a_worker_that_differs_and_comes_later_is_refused(scene, machines):
    machines.start_worker(ILLUM_TEST_DELAY="1")
    client = Client(scene.parent, "--cluster", machines.address)
    client.wait_for(1)
    machines.start_worker(ILLUM_TEST_FACTS="illum=0.0.1")
    errors = client.finish(2)
    assert "illum is 0.0.1, not" in errors
