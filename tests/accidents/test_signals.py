"""Kill -9, SIGINT and SIGTERM at random moments: no incomplete file, the next run gives the same bytes."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import sys
import time

import pytest

BIG = ["-D", "film={width: 800, height: 600, samples: 1}", "-q", "-t", "1"]


def files(folder):
    return {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted((folder / "out").glob("[!.]*"))
    }


def command(folder):
    return [sys.executable, "-m", "illumcli", "render", "scene.yaml", *BIG]


@pytest.fixture
def whole(folder):
    """The files of a run that nothing stopped, and its seconds."""
    env = {**os.environ, "ILLUM_CACHE": str(folder / "cache0")}
    start = time.monotonic()
    subprocess.run(command(folder), cwd=folder, env=env, check=True, stdout=subprocess.DEVNULL)
    seconds = time.monotonic() - start
    found = files(folder)
    for path in (folder / "out").iterdir():
        path.unlink()
    return found, seconds


def stopped(folder, number, after):
    """The run's end after a signal, and how long it took to end."""
    env = {**os.environ, "ILLUM_CACHE": str(folder / "cache")}
    with subprocess.Popen(
        command(folder), cwd=folder, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as run:
        time.sleep(after)
        sent = time.monotonic()
        run.send_signal(number)
        _, said = run.communicate(timeout=60)
        return run.returncode, time.monotonic() - sent, said


def tries(few, many):
    return [few, pytest.param(many, marks=pytest.mark.slow)]


@pytest.mark.parametrize("count", tries(2, 50))
def test_kill_leaves_whole_files_and_the_next_run_the_same_bytes(folder, whole, count):
    expected, seconds = whole
    draw = random.Random(1)
    for _ in range(count):
        stopped(folder, signal.SIGKILL, draw.uniform(0.2, 1.0) * seconds)
        found = files(folder)
        assert all(expected[name] == found[name] for name in found)
    env = {**os.environ, "ILLUM_CACHE": str(folder / "cache")}
    done = subprocess.run(command(folder), cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert files(folder) == expected
    assert not list(folder.rglob("out/*.part")) + list(folder.rglob("out/.*.part"))


@pytest.mark.parametrize("count", tries(1, 50))
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_by_itself_without_a_word_or_a_part(folder, whole, number, count):
    expected, seconds = whole
    draw = random.Random(2)
    for _ in range(count):
        code, _, said = stopped(folder, number, draw.uniform(0.25, 0.9) * seconds)
        found = files(folder)
        assert all(expected[name] == found[name] for name in found)
        if found != expected:
            assert code == -number, said
        assert "Traceback" not in said, said
        assert not list(folder.rglob(".*.part"))
