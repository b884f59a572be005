"""Claims: one holder at a time, stale ones are taken over, nothing is left, no claim is no hindrance."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time

import pytest

from illumcli.files import claims as module
from illumcli.files.atomic import discard_open
from illumcli.files.claims import Claims, claim_path, tidy

HOLDER = """
import sys, time
from pathlib import Path
from illumcli.files.claims import Claims
with Claims().take(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def untidied(monkeypatch):
    monkeypatch.setattr(module, "_tidied", set())


@pytest.fixture
def path(tmp_path):
    return claim_path(tmp_path / "out" / "a.png", "0123456789abcdef" * 2)


@pytest.fixture
def holder(path):
    """Another process that holds the claim."""
    with subprocess.Popen([sys.executable, "-c", HOLDER, path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def other_machines(path):
    """Write a claim as a process of another machine leaves it, whose lock does not show here."""
    path.parent.mkdir(exist_ok=True)
    path.write_text("another boot")


def test_one_process_holds_a_claim_at_a_time(path):
    with Claims().take(path):
        assert path.exists()
        assert Claims().take(path) is None
        with Claims().take(claim_path(path, "f" * 32)) as other:
            assert other is not None
    assert not path.parent.exists()
    with Claims().take(path):
        pass


def test_the_folder_stays_where_something_was_written(path):
    with Claims().take(path):
        (path.parent / "a.png").touch()
    assert [each.name for each in path.parent.iterdir()] == ["a.png"]


def test_the_claim_of_a_killed_process_is_taken_over_at_once(path, holder):
    claims = Claims()
    assert claims.take(path) is None
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert path.exists()
    with claims.take(path):
        assert Claims().take(path) is None
    assert not path.exists()


def test_the_claim_of_another_machine_is_taken_over_when_it_is_silent(path, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    other_machines(path)
    claims, now = Claims(), time.time()
    for beat in range(20):
        os.utime(path, (now + beat, now + beat))
        assert claims.take(path) is None
        clock[0] += module.STALE - 1
        assert Claims().take(path) is None
    os.utime(path, (now, now))
    assert claims.take(path) is None
    clock[0] += module.STALE + 1
    with claims.take(path):
        assert path.read_bytes() == module._machine()
    assert not path.exists()


def test_a_process_that_was_stopped_for_long_leaves_the_claim_of_the_next(path, monkeypatch):
    clock = [0.0]
    claims = Claims()
    with Claims().take(path):
        monkeypatch.setattr(time, "monotonic", lambda: clock[0])
        assert claims.take(path) is None
        clock[0] += module.STALE + 1
        second = claims.take(path)
        assert second is not None
    assert path.exists()
    with second:
        pass
    assert not path.exists()


def test_a_holder_touches_its_claim(path, monkeypatch):
    monkeypatch.setattr(module, "BEAT", 0.01)
    with Claims().take(path):
        os.utime(path, (1, 1))
        for _ in range(500):
            if path.stat().st_mtime > 1:
                break
            time.sleep(0.01)
        assert path.stat().st_mtime > 1


def test_a_signal_that_ends_the_process_removes_its_claims(path):
    with Claims().take(path):
        discard_open()
        assert not path.exists()


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EDQUOT])
@pytest.mark.parametrize("call", ["open", "mkdir", "pwrite", "scandir"])
def test_where_no_claim_can_be_made_the_work_is_done(path, monkeypatch, code, call):
    def fails(*words, **more):
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patched:
        patched.setattr(os, call, fails)
        with Claims().take(path) as claim:
            assert claim is not None
    assert not path.exists()


@pytest.mark.parametrize("kind", ["link", "pipe", "folder", "another user"])
def test_what_is_no_claim_of_this_user_is_neither_waited_for_nor_changed(path, tmp_path, kind):
    path.parent.mkdir()
    victim = tmp_path / "victim"
    victim.write_text("precious")
    match kind:
        case "link":
            path.symlink_to(victim)
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case _:
            if os.geteuid():
                pytest.skip("needs root to make a file of another user")
            other_machines(path)
            os.chown(path, 12345, 12345)
    before = os.lstat(path)
    with Claims().take(path) as claim:
        assert claim is not None
    tidy(path.parent)
    assert (os.lstat(path).st_ino, os.lstat(path).st_mtime) == (before.st_ino, before.st_mtime)
    assert victim.read_text() == "precious"


def test_claims_of_killed_processes_are_tidied_and_others_not(path, holder):
    held, killed, elsewhere, old = (path.with_name(f".{k * 12}.{k * 32}.claim") for k in "1234")
    with Claims().take(held):
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        path.rename(killed)
        other_machines(elsewhere)
        other_machines(old)
        os.utime(old, (1, 1))
        (path.parent / ".mine.claim").touch()
        module._tidied.clear()
        tidy(path.parent)
        assert {each.name for each in path.parent.iterdir()} == {held.name, elsewhere.name, ".mine.claim"}
