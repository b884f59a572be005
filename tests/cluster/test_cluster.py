"""Renders, sweeps and bakes on clusters: the same files as in one process."""

from __future__ import annotations

import csv
import os
import socket
import subprocess
import sys
from contextlib import suppress

import pytest

from cluster.machines import HIDDEN
from illumcli.cluster.address import Address, address_of
from illumcli.cluster.facts import facts, refuse_differences
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


def test_workers_that_differ_are_named_with_what_differs():
    own = facts()
    refuse_differences(own, {"a:1": own})
    with pytest.raises(InputError) as caught:
        refuse_differences(
            own, {"tcp://a:1": own, "tcp://b:2": {**own, "numpy": "1.0", "instructions": "AVX"}}
        )
    assert len(caught.value.problems) == 3
    assert "worker tcp://b:2: has numpy 1.0, this process" in str(caught.value)
    assert "--mixed-workers" in str(caught.value)


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
