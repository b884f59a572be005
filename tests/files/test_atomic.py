"""Files appear completely or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from illumcli.errors import OutputError
from illumcli.files import atomic
from illumcli.files.atomic import AtomicFile, write_bytes, write_text
from illumcli.images.writer import ImageWriter


def parts(folder: Path) -> list[str]:
    return [name for name in os.listdir(folder) if name.endswith(".part")]


def test_text_and_bytes_arrive_as_they_are(tmp_path):
    write_text(tmp_path / "a.txt", "één\r\ntwo\n")
    write_bytes(tmp_path / "b.bin", b"\0\xff\r\n")
    assert (tmp_path / "a.txt").read_bytes() == "één\r\ntwo\n".encode()
    assert (tmp_path / "b.bin").read_bytes() == b"\0\xff\r\n"
    assert sorted(os.listdir(tmp_path)) == ["a.txt", "b.bin"]


def test_missing_folders_are_made(tmp_path):
    write_text(tmp_path / "x" / "y" / "a.txt", "here")
    assert (tmp_path / "x" / "y" / "a.txt").read_text() == "here"


def test_old_file_stays_until_the_new_one_is_whole(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")
    with AtomicFile(target) as part:
        part.path.write_text("new")
        assert target.read_text() == "old"
        assert len(parts(tmp_path)) == 1
    assert target.read_text() == "new"


def test_new_files_have_the_usual_permissions(tmp_path):
    (tmp_path / "usual").write_text("")
    write_text(tmp_path / "ours", "")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_link_is_kept_and_the_file_behind_it_replaced(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, ZeroDivisionError, MemoryError])
def test_whatever_stops_the_writer_leaves_no_debris(tmp_path, stop):
    (tmp_path / "a.txt").write_text("old")

    def stopped():
        with AtomicFile(tmp_path / "a.txt") as part:
            part.path.write_text("half of")
            raise stop

    with pytest.raises(stop):
        stopped()
    assert os.listdir(tmp_path) == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"
    assert not [path for path in atomic._open if path.parent == tmp_path]
    write_text(tmp_path / "a.txt", "new")
    assert not [path for path in atomic._open if path.parent == tmp_path]


def test_folder_in_the_place_of_the_file_is_refused(tmp_path):
    (tmp_path / "out").mkdir()
    with pytest.raises(OutputError, match="out: is a folder or a device; give the name of a file"):
        write_text(tmp_path / "out", "")


def test_device_is_never_replaced():
    with pytest.raises(OutputError, match="/dev/null: is a folder or a device"):
        write_text("/dev/null", "")
    assert Path("/dev/null").is_char_device()


def test_path_below_a_file_is_refused_with_a_way_out(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file/a.txt: cannot be written: .*; part of the path is a file"):
        write_text(tmp_path / "file" / "a.txt", "")


def test_the_longest_name_that_the_system_takes_is_written_and_no_longer_one(tmp_path):
    longest = os.pathconf(tmp_path, "PC_NAME_MAX")
    for letter in ("a", "é", "漢"):
        name = letter * (longest // len(letter.encode()))
        write_text(tmp_path / name, "here")
        assert (tmp_path / name).read_text() == "here"
        with pytest.raises(OutputError, match=r"shorten the name"):
            write_text(tmp_path / (name + letter), "")
    assert parts(tmp_path) == []


@pytest.mark.parametrize("call", ["open", "fsync", "replace", "scandir", "fstat", "lstat"])
@pytest.mark.parametrize(
    ("number", "way"),
    [
        (errno.ENOSPC, "No space left on device; free some space"),
        (errno.EACCES, "Permission denied; choose a folder you may write to"),
        (errno.EROFS, "Read-only file system; choose a folder you may write to"),
        (errno.EIO, "Input/output error; choose another place"),
    ],
)
def test_refused_system_calls_are_output_errors(tmp_path, monkeypatch, call, number, way):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(atomic.os, call, refuse)
    with pytest.raises(OutputError, match=f"a.txt: cannot be written: {way}") as caught:
        write_text(tmp_path / "a.txt", "text")
    monkeypatch.undo()
    assert caught.value.exit_code == 5
    assert not (tmp_path / "a.txt").exists()
    assert parts(tmp_path) == [] or call == "fstat"  # of the file that was just made: left for the next run


def test_full_disk_while_writing_is_an_output_error(tmp_path):

    def fill():
        with AtomicFile(tmp_path / "a.txt"), open("/dev/full", "w") as full:
            full.write("text")

    with pytest.raises(OutputError, match="No space left on device; free some space"):
        fill()
    assert os.listdir(tmp_path) == []


def test_error_of_another_file_stays_what_it_is(tmp_path):
    with pytest.raises(FileNotFoundError), AtomicFile(tmp_path / "a.txt"):
        (tmp_path / "missing").read_text()
    assert os.listdir(tmp_path) == []


def test_parts_that_nobody_holds_are_removed_and_no_others(tmp_path):
    target, other = tmp_path / "a.txt", AtomicFile(tmp_path / "b.txt")
    (live,) = parts(tmp_path)
    dead = [atomic.beside(tmp_path / name, "0123abcd.part") for name in ("a.txt", "c.txt")]
    mine = tmp_path / ".a.txt.part"
    for path in (*dead, mine):
        path.write_text("half")
    atomic._tidied.clear()
    write_text(target, "whole")
    assert sorted(os.listdir(tmp_path)) == sorted([live, "a.txt", mine.name])
    other.path.write_text("whole")
    other.commit()
    assert (tmp_path / "b.txt").read_text() == "whole"


LIVE = """
import sys, time
from illumcli.files.atomic import AtomicFile
with AtomicFile(sys.argv[1]) as part:
    part.path.write_text("theirs")
    print("there", flush=True)
    sys.stdin.read()
"""


def test_the_part_of_a_live_process_is_kept_whatever_its_host_and_number_seem(tmp_path):
    target = tmp_path / "a.txt"
    with subprocess.Popen(
        [sys.executable, "-c", LIVE, target], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        process.stdout.readline()
        write_text(target, "ours")
        assert len(parts(tmp_path)) == 1
        process.communicate("")
    assert process.returncode == 0
    assert target.read_text() == "theirs"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o644, 0o444, 0o755, 0o4755])
def test_the_mode_of_a_replaced_file_is_kept(tmp_path, mode):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "a.txt").chmod(mode)
    with AtomicFile(tmp_path / "a.txt") as part:
        (name,) = parts(tmp_path)
        assert (tmp_path / name).stat().st_mode & 0o077 == 0
        part.path.write_text("new")
    assert (tmp_path / "a.txt").stat().st_mode & 0o7777 == mode & 0o777


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_the_owner_of_a_replaced_file_is_kept(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    os.chown(tmp_path / "a.txt", 12345, 23456)
    write_text(tmp_path / "a.txt", "new")
    status = (tmp_path / "a.txt").stat()
    assert (status.st_uid, status.st_gid) == (12345, 23456)


@pytest.mark.parametrize("name", ["a.txt", "a.png", "a.exr"])
def test_a_link_that_takes_the_place_of_a_part_is_not_followed(tmp_path, name):
    victim = tmp_path / "victim"
    victim.write_text("precious")

    def swap():
        (planted,) = parts(tmp_path)
        (tmp_path / planted).unlink()
        (tmp_path / planted).symlink_to(victim)

    def write():
        if name == "a.txt":
            with AtomicFile(tmp_path / name) as part:
                swap()
                part.path.write_text("new")
            return
        kind = {"a.png": "uint8", "a.exr": "half"}[name]
        with ImageWriter(tmp_path / name, 4, 4, dict.fromkeys("RGB", kind)) as image:
            swap()
            image.write_band(0, np.zeros((4, 4, 3), np.uint8 if kind == "uint8" else np.float32))

    with pytest.raises(OutputError, match="another file took its place"):
        write()
    assert victim.read_text() == "precious"
    assert sorted(os.listdir(tmp_path)) == ["victim"]


@pytest.mark.parametrize("kind", ["symbolic link", "hard link", "pipe", "folder", "held"])
def test_planted_parts_are_neither_opened_nor_waited_for(tmp_path, kind):
    victim, planted = tmp_path / "victim", atomic.beside(tmp_path / "a.txt", "0123abcd.part")
    victim.write_text("precious")
    match kind:
        case "symbolic link":
            planted.symlink_to(victim)
        case "hard link":
            os.link(victim, planted)
        case "pipe":
            os.mkfifo(planted)
        case "folder":
            planted.mkdir()
        case "held":
            planted.write_text("")
    held = atomic.claim(planted) if kind == "held" else None
    write_text(tmp_path / "a.txt", "whole")
    assert victim.read_text() == "precious"
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert os.path.lexists(planted)
    if held is not None:
        os.close(held)


def test_a_system_without_names_for_open_files_or_without_locks_writes_too(tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(atomic.fcntl, "flock", refuse)
    monkeypatch.setattr(atomic, "_OPEN_FILES", "/proc/none")
    left = atomic.beside(tmp_path / "a.txt", "0123abcd.part")
    left.write_text("perhaps alive")
    write_text(tmp_path / "a.txt", "whole")
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert left.exists()


def test_killed_process_leaves_no_file_and_the_next_run_tidies_up(tmp_path):
    script = f"""
import os, signal
from illumcli.files.atomic import AtomicFile
with AtomicFile({str(tmp_path / "a.txt")!r}) as part:
    part.path.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", script])
    assert not (tmp_path / "a.txt").exists()
    assert len(parts(tmp_path)) == 1
    write_text(tmp_path / "a.txt", "whole")
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_signal_that_falls_before_the_block_leaves_no_file_either(tmp_path, monkeypatch):
    stop = KeyboardInterrupt()
    create = os.open

    def created_then_stopped(*words):
        os.close(create(*words))
        raise stop

    monkeypatch.setattr(os, "open", created_then_stopped)
    with pytest.raises(KeyboardInterrupt):
        atomic.AtomicFile(tmp_path / "a.txt")
    assert len(os.listdir(tmp_path)) == 1
    atomic.discard_open()
    assert os.listdir(tmp_path) == []


def test_a_part_that_is_gone_already_is_discarded_too(tmp_path):
    part = AtomicFile(tmp_path / "a.txt")
    (tmp_path / parts(tmp_path)[0]).unlink()
    part.discard()
    assert not [path for path in atomic._open if path.parent == tmp_path]
