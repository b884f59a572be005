"""Renders, sweeps and bakes on clusters: the same files as in one process."""

from __future__ import annotations

import csv
import os
import socket
import subprocess
import sys
from contextlib import suppress
from math import inf

import pytest

from cluster.machines import HIDDEN
from illumcli.cluster.address import Address, address_of
from illumcli.cluster.block import Block, block_size
from illumcli.cluster.facts import differences, facts
from illumcli.errors import InputError

SWEEP = ["sweep", "s.yaml", "-D", "materials.clay.exponent=1:100:6", "--no-cache"]


def illum(folder, *words, check=True):
    done = subprocess.run(
        [sys.executable, "-m", "illumcli", *words], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0 or not check, done.stderr
    return done


def pictures(folder, suffix=".png"):
    return {path.name: path.read_bytes() for path in sorted(folder.glob(f"s-*{suffix}"))}


@pytest.fixture
def expected(scene):
    illum(scene.parent, *SWEEP)
    found = pictures(scene.parent)
    assert len(found) == 6
    for name in found:
        (scene.parent / name).unlink()
    return found


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("local:3", Address(local=3)),
        ("local", Address(local=len(os.sched_getaffinity(0)))),
        ("tcp://host:8786", Address(scheduler="tcp://host:8786")),
        ("tls://10.0.0.1:1", Address(scheduler="tls://10.0.0.1:1")),
    ],
)
def test_addresses(text, address):
    assert address_of(text) == address


@pytest.mark.parametrize("text", ["local:0", "local:9999", "local:x", "http://a:1", "tcp://a", "none.json"])
def test_addresses_that_name_no_cluster_are_refused(text):
    with pytest.raises(InputError, match=text):
        address_of(text)


def test_what_differs_between_a_worker_and_the_client():
    own = facts()
    assert differences(own, own) == ()
    assert differences({**own, "numpy": "1.0"}, own) == (f"has numpy 1.0, not {own['numpy']}",)
    without = {name: value for name, value in own.items() if name != "instructions"}
    assert differences(without, own) == (f"has instructions of no known version, not {own['instructions']}",)
    assert differences(own, {}) == ()


@pytest.mark.parametrize(
    ("left", "workers", "seconds", "size"),
    [(200, 2, inf, 1), (200, 2, 0.05, 20), (200, 2, 0.01, 25), (200, 2, 3.0, 1), (3, 2, 0.01, 1)],
)
def test_a_block_takes_a_second_and_the_last_ones_are_small(left, workers, seconds, size):
    assert block_size(left, workers, seconds) == size


def test_workers_that_may_do_a_block():
    both = frozenset({"a", "b"})
    assert Block((1,)).among(both) == both
    assert Block((1,), failed_on=frozenset({"a"})).among(both) == {"b"}
    assert Block((1,), failed_on=both).among(both) == both
    assert Block((1,), asker="a").among(both) == {"a"}
    assert Block((1,), asker="c").among(both) == both


def test_local_workers_write_the_same_files(scene, expected):
    with socket.socket() as other:
        with suppress(OSError):  # Dask's default port is taken, here or already
            other.bind(("127.0.0.1", 8787))
            other.listen()
        done = illum(scene.parent, *SWEEP, "--cluster", "local:2", "--table", "t.csv", "-q")
    assert sorted(done.stdout.split()) == sorted(expected)
    assert pictures(scene.parent) == expected
    rows = list(csv.DictReader((scene.parent / "t.csv").read_text().splitlines()))
    assert [row["state"] for row in rows] == ["rendered"] * 6
    assert done.stderr == ""
    again = illum(scene.parent, *SWEEP, "--cluster", "local:2")
    assert again.stderr.count("kept, its content is the same") == 6


def test_renders_and_bakes_of_several_inputs_and_their_errors(scene):
    folder = scene.parent
    (folder / "bad.obj").write_text("f 1 2 3\n")
    words = ["ao-bake", "meshes/floor.obj", "bad.obj", "--samples", "16", "-o"]
    done = illum(folder, *words, "{scene}.npz", "--cluster", "local:1", check=False)
    assert done.returncode == 2
    assert done.stdout.split() == ["floor.npz"]
    assert "bad.obj" in done.stderr
    scenes = ["s.yaml", "meshes/floor.obj", "-D", "film.width=16", "-D", "film.height=12"]
    done = illum(folder, "render", *scenes, "-o", "{scene}.exr", "--cluster", "local:1")
    assert sorted(done.stdout.split()) == ["floor.exr", "s.exr"]


@pytest.mark.parametrize("is_hidden", [False, True])
def test_workers_of_a_scheduler_with_and_without_a_shared_folder(scene, expected, machines, is_hidden):
    if is_hidden and os.geteuid() != 0:
        pytest.skip("only root can hide a folder from a process")
    for _ in range(2):
        machines.start_worker([*HIDDEN, str(scene.parent)] if is_hidden else [])
    done = illum(scene.parent, *SWEEP, "--cluster", machines.address)
    assert pictures(scene.parent) == expected
    assert done.stderr.count("without TLS") == 1
    assert sorted(os.listdir(scene.parent)) == sorted([*expected, "meshes", "s.yaml", "t.png"])
    left = list(machines.folder.glob("worker*/dask-scratch-space/*/illum-*"))
    assert left == []
