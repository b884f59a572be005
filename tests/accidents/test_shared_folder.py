"""Two processes with one command and one folder: nothing is done twice, a killed one's work is taken over."""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time

import pytest

SWEEP = ("sweep", "scene.yaml", "-D", "seed=1:12:12", "-o", "out/{seed}.png", "--only", "beauty", "-t", "1")
BAKE = (
    "ao-bake",
    "1.obj",
    "2.obj",
    "3.obj",
    "4.obj",
    "-o",
    "out/{scene}.npz",
    "--samples",
    "2048",
    "-t",
    "1",
)
RENDER = (
    "render",
    "1.yaml",
    "2.yaml",
    "3.yaml",
    "4.yaml",
    "-o",
    "out/{scene}.png",
    "--only",
    "beauty",
    "-t",
    "1",
)
COMMANDS = {"sweep": SWEEP, "ao-bake": BAKE, "render": RENDER}


def grid(side):
    """A wavy square of this many vertices along its side, as OBJ."""
    places = [(x, y) for y in range(side) for x in range(side)]
    corners = [x + y * side + 1 for x, y in places if x < side - 1 and y < side - 1]
    vertices = [f"v {x} {y} {x * x % 3}" for x, y in places]
    return "\n".join([*vertices, *(f"f {k} {k + 1} {k + side + 1} {k + side}" for k in corners)])


@pytest.fixture
def start(folder):
    """Start a command in a process of its own, without a cache that it could share."""
    for number in range(1, 5):
        (folder / f"{number}.obj").write_text(grid(30 + number))
        (folder / f"{number}.yaml").write_text((folder / "scene.yaml").read_text() + f"seed: {number}\n")
    running = []

    def run(name, report):
        cache = (
            () if name == "ao-bake" else ("--no-cache", "-D", "film={width: 240, height: 180, samples: 2}")
        )
        command = [sys.executable, "-m", "illumcli", *COMMANDS[name], *cache, "--report", report]
        process = subprocess.Popen(
            command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        running.append(process)
        return process

    yield run
    for process in running:
        process.kill()
        process.communicate()


def files(folder):
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (folder / "out").glob("[!.]*")
    }


def written(folder, report):
    return [name for entry in json.loads((folder / report).read_text()) for name in entry["written"]]


def whole(folder, start, name):
    """The files of one process that nothing disturbs; they are removed."""
    process = start(name, "whole.json")
    assert process.wait() == 0, process.stderr.read()
    found = files(folder)
    for path in (folder / "out").iterdir():
        path.unlink()
    return found


@pytest.mark.parametrize("name", COMMANDS)
def test_two_processes_share_the_work(folder, start, name):
    expected = whole(folder, start, name)
    processes = [start(name, "a.json"), start(name, "b.json")]
    for process in processes:
        said, told = process.communicate(timeout=200)
        assert process.returncode == 0, told
        assert len(said.splitlines()) == len(expected)  # each names every file
    a, b = written(folder, "a.json"), written(folder, "b.json")
    print(f"{name}: {len(a)} and {len(b)} of {len(expected)}")  # pytest -rP shows it
    assert sorted(a + b) == sorted(f"out/{each}" for each in expected)
    assert files(folder) == expected
    assert not list((folder / "out").glob(".*"))


def stop_with_claim(process, folder, delay=0.0):
    """Stop a process, the only one that works here, at a moment when it holds a claim."""

    def holds():
        return list((folder / "out").glob(".*.claim"))

    while process.poll() is None:
        if holds():
            time.sleep(delay)
            process.send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
            if holds():
                return
            process.send_signal(signal.SIGCONT)
        time.sleep(0.001)
    raise AssertionError(f"ended before it was stopped: {process.communicate()}")


@pytest.mark.parametrize("count", [2, pytest.param(10, marks=pytest.mark.slow)])
def test_the_work_of_a_killed_process_is_taken_over(folder, start, count):
    expected, draw = whole(folder, start, "sweep"), random.Random(1)
    for _ in range(count):
        first = start("sweep", "a.json")
        stop_with_claim(first, folder, draw.uniform(0, 0.1))
        before = files(folder)
        second = start("sweep", "b.json")
        while len(files(folder)) < min(len(before) + 1, len(expected) - 1):
            assert second.poll() is None, second.communicate()
            time.sleep(0.002)
        first.kill()
        first.wait()
        _, told = second.communicate(timeout=200)
        assert second.returncode == 0, told
        assert files(folder) == expected
        assert not list((folder / "out").glob(".*"))
        assert len(written(folder, "b.json")) == len(expected) - len(before)
        for path in [*(folder / "out").iterdir(), *folder.glob("?.json")]:
            path.unlink()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_process_leaves_no_claim(folder, start, number):
    process = start("sweep", "a.json")
    stop_with_claim(process, folder)
    process.send_signal(number)
    process.send_signal(signal.SIGCONT)
    process.communicate(timeout=60)
    assert process.returncode == -number
    assert not list((folder / "out").glob(".*"))


def test_a_process_that_finds_all_work_claimed_waits_and_keeps_the_files(folder, start, tmp_path):
    expected = whole(folder, start, "sweep")
    first = start("sweep", "a.json")
    stop_with_claim(first, folder)
    before = files(folder)
    second = start("sweep", "b.json")
    while len(files(folder)) < len(expected) - 1:
        assert second.poll() is None, second.communicate()
        time.sleep(0.05)
    time.sleep(1)
    assert second.poll() is None
    os.kill(first.pid, signal.SIGCONT)
    for process in (first, second):
        assert process.wait(timeout=60) == 0
    assert files(folder) == expected
    assert len(written(folder, "a.json")) == len(before) + 1
    assert not list((folder / "out").glob(".*"))
