"""Bakes that are killed, run twice at once, or meet foreign files or a full disk: right values or none."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress

import pytest

from illumcli.baking.bake import bake_mesh
from illumcli.baking.inputs import prepare_bake
from illumcli.baking.sampling import BakeSampler
from illumcli.baking.settings import BakeJob, BakeOptions, BakeSettings
from illumcli.files.journal import place

RAYS = 1 << 10
"""Of a piece: small, so that small bakes have many."""


@pytest.fixture
def mesh(tmp_path, monkeypatch):
    """A bumpy sheet, whose bake takes some fifty pieces."""
    monkeypatch.setattr("illumcli.baking.sampling.UNIT_RAYS", RAYS)
    return sheet(tmp_path / "mesh.obj", 16)


def sheet(path, side):
    draw = random.Random(7)
    lines = [f"v {x} {y} {draw.uniform(0, 2)}" for x in range(side) for y in range(side)]
    for x in range(side - 1):
        for y in range(side - 1):
            a = x * side + y + 1
            lines.append(f"f {a} {a + side} {a + side + 1} {a + 1}")
    path.write_text("\n".join(lines) + "\n")
    return path


def bake(mesh, out, seed=0, **more):
    return bake_mesh(mesh, [out], BakeSettings(samples=64, seed=seed), BakeOptions(threads=2, **more))[1]


def interrupted(monkeypatch, after, at=lambda piece: None):
    """From now on a bake is interrupted after so many pieces; `at` is called with the number of each."""
    whole, done = BakeSampler._run, []

    def breaks(self, what, pieces, ask):
        for found in whole(self, what, pieces, ask):
            if what == "values":
                at(len(done))
                if len(done) == after:
                    raise KeyboardInterrupt
                done.append(found)
            yield found

    monkeypatch.setattr(BakeSampler, "_run", breaks)
    return whole


def hidden(folder):
    return sorted(p.name for p in folder.glob(".*"))


def test_two_bakes_to_one_file_never_get_each_others_values(mesh, tmp_path, monkeypatch):
    for count in range(1, 11):
        out = tmp_path / f"{count}.npz"
        bake(mesh, tmp_path / "whole.npz", seed=2, force=True)
        whole = BakeSampler._run

        def other(piece, count=count, out=out, whole=whole):
            # in the middle of the first bake the second starts and is killed, too
            if piece == count:
                monkeypatch.setattr(BakeSampler, "_run", whole)
                interrupted(monkeypatch, 1)
                with suppress(KeyboardInterrupt):
                    bake(mesh, out, seed=2)

        interrupted(monkeypatch, count + 20, other)
        with suppress(KeyboardInterrupt):
            bake(mesh, out, seed=1)
        monkeypatch.setattr(BakeSampler, "_run", whole)
        bake(mesh, out, seed=2)
        assert out.read_bytes() == (tmp_path / "whole.npz").read_bytes(), count


def test_an_equal_bake_that_runs_already_is_neither_disturbed_nor_waited_for(mesh, tmp_path, monkeypatch):
    out, twin = tmp_path / "out.npz", tmp_path / "twin.npz"
    whole = BakeSampler._run
    said = []

    def other(piece):
        if piece == 5:
            monkeypatch.setattr(BakeSampler, "_run", whole)
            said.append(bake(mesh, out))
            os.rename(out, twin)

    interrupted(monkeypatch, 10, other)
    with pytest.raises(KeyboardInterrupt):
        bake(mesh, out)
    monkeypatch.setattr(BakeSampler, "_run", whole)
    assert said[0].sampled["obscurance"].resumed == 0
    assert any("in use" in line for line in said[0].warnings)
    assert bake(mesh, out).sampled["obscurance"].resumed == 10 * RAYS
    assert out.read_bytes() == twin.read_bytes()
    assert hidden(tmp_path) == []


@pytest.mark.parametrize("kind", ["npz", "ply", "glb"])
def test_a_bake_taken_up_again_gives_the_same_file(mesh, tmp_path, monkeypatch, kind):
    bake(mesh, tmp_path / f"whole.{kind}")
    out = tmp_path / f"out.{kind}"
    for after in (1, 20, 3):
        whole = interrupted(monkeypatch, after)
        with pytest.raises(KeyboardInterrupt):
            bake(mesh, out)
        monkeypatch.setattr(BakeSampler, "_run", whole)
    assert bake(mesh, out).sampled["obscurance"].resumed == 24 * RAYS
    assert out.read_bytes() == (tmp_path / f"whole.{kind}").read_bytes()
    assert hidden(tmp_path) == []


def test_damaged_pieces_are_made_again(mesh, tmp_path, monkeypatch):
    bake(mesh, tmp_path / "whole.npz")
    draw = random.Random(3)
    for number in range(20):
        out = tmp_path / f"{number}.npz"
        whole = interrupted(monkeypatch, 12)
        with pytest.raises(KeyboardInterrupt):
            bake(mesh, out)
        monkeypatch.setattr(BakeSampler, "_run", whole)
        (kept,) = tmp_path.glob(".*.unfinished")
        data = bytearray(kept.read_bytes())
        at = draw.randrange(len(data))
        data[at] ^= 1 << draw.randrange(8)
        kept.write_bytes(data if number % 2 else data[:at])
        bake(mesh, out)
        assert out.read_bytes() == (tmp_path / "whole.npz").read_bytes()
        assert hidden(tmp_path) == []


def test_what_a_kill_between_the_rename_and_the_end_leaves_is_removed(mesh, tmp_path, monkeypatch):
    out = tmp_path / "out.npz"
    whole = interrupted(monkeypatch, 5)
    with pytest.raises(KeyboardInterrupt):
        bake(mesh, out)
    monkeypatch.setattr(BakeSampler, "_run", whole)
    (kept,) = tmp_path.glob(".*.unfinished")
    left = kept.read_bytes()
    bake(mesh, out)
    kept.write_bytes(left)
    kept.chmod(0o600)
    assert bake(mesh, out).kept == [str(out)]
    assert hidden(tmp_path) == []


def test_a_journal_that_nobody_takes_up_goes_with_the_next_bake_of_its_output(mesh, tmp_path, monkeypatch):
    out, other = tmp_path / "out.npz", tmp_path / "other.npz"
    for path in (out, other):
        whole = interrupted(monkeypatch, 5)
        with pytest.raises(KeyboardInterrupt):
            bake(mesh, path, seed=1)
        monkeypatch.setattr(BakeSampler, "_run", whole)
    assert len(hidden(tmp_path)) == 2
    bake(mesh, out, seed=2)
    (kept,) = tmp_path.glob(".*.unfinished")  # of the other output
    os.utime(kept, (0, time.time() - 8 * 86400))
    bake(mesh, tmp_path / "third.npz")
    assert hidden(tmp_path) == []


PLANTED = ["symbolic link", "hard link", "pipe", "folder", "open to others", "of another user"]


@pytest.mark.parametrize("kind", PLANTED)
def test_no_planted_file_is_written_through_or_waited_for(mesh, tmp_path, kind):
    if kind == "of another user" and os.geteuid() != 0:
        pytest.skip("only root can plant a file of another user")
    out, victim = tmp_path / "out.npz", tmp_path / "victim"
    victim.write_text("precious")
    where = place(out, prepare_bake(BakeJob(mesh, (out,), BakeSettings(samples=64))).content)
    match kind:
        case "symbolic link":
            where.symlink_to(victim)
        case "hard link":
            os.link(victim, where)
        case "pipe":
            os.mkfifo(where)
        case "folder":
            where.mkdir()
        case _:
            where.write_bytes(b"")
            where.chmod(0o666)
            if kind == "of another user":
                os.chown(where, 12345, 12345)
    done = []
    baking = threading.Thread(target=lambda: done.append(bake(mesh, out)), daemon=True)
    baking.start()
    baking.join(60)
    assert done, "the bake hangs"
    assert victim.read_text() == "precious"
    bake(mesh, tmp_path / "whole.npz")
    assert out.read_bytes() == (tmp_path / "whole.npz").read_bytes()


KINDS = ("npz", "ply", "glb")


@pytest.fixture
def disk(tmp_path):
    """Mounts a small file system of so many KiB; only root can."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a tmpfs")
    folder = tmp_path / "disk"
    folder.mkdir()

    def mounted(kib):
        subprocess.run(["umount", folder], capture_output=True)
        mount = ["mount", "-t", "tmpfs", "-o", f"size={kib}k", "tmpfs", folder]
        if subprocess.run(mount, capture_output=True).returncode != 0:
            pytest.skip("no tmpfs can be mounted here")
        return folder

    yield mounted
    subprocess.run(["umount", folder], capture_output=True)


@pytest.mark.parametrize(
    "sizes", [(4, 12, 40, 80), pytest.param(tuple(range(4, 100, 4)), marks=pytest.mark.slow)]
)
def test_a_full_disk_is_exit_5_and_nothing_is_left_on_it(tmp_path, disk, sizes):
    mesh = sheet(tmp_path / "mesh.obj", 40)
    for kib in sizes:
        for kind in KINDS:
            folder = disk(kib)
            code, said = ao_bake(mesh, folder / f"out.{kind}", "--samples", "16")
            assert code in (0, 5), (kib, kind, code, said)
            assert sorted(os.listdir(folder)) == ([f"out.{kind}"] if code == 0 else []), (kib, kind, said)


def ao_bake(mesh, out, *words):
    done = subprocess.run(
        [sys.executable, "-m", "illumcli", "ao-bake", mesh, "-o", out, "-q", *words],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr


@pytest.mark.parametrize("count", [3, pytest.param(60, marks=pytest.mark.slow)])
def test_killed_bakes_leave_the_whole_file_or_none_and_at_last_the_same_bytes(tmp_path, count):
    mesh, out = sheet(tmp_path / "mesh.obj", 120), tmp_path / "out.npz"
    start = time.monotonic()
    assert ao_bake(mesh, tmp_path / "whole.npz", "--samples", "256") == (0, "")
    seconds = time.monotonic() - start
    expected = (tmp_path / "whole.npz").read_bytes()
    draw = random.Random(5)
    for _ in range(count):
        command = [sys.executable, "-m", "illumcli", "ao-bake", mesh, "-o", out, "--samples", "256", "-q"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
            time.sleep(draw.uniform(0.4, 1.05) * seconds)
            process.send_signal(signal.SIGKILL)
        if out.exists():
            assert out.read_bytes() == expected
            out.unlink()
    assert ao_bake(mesh, out, "--samples", "256") == (0, "")
    assert out.read_bytes() == expected
    assert hidden(tmp_path) == []
