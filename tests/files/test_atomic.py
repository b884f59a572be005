"""Files appear whole or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from illumcli.errors import OutputError
from illumcli.files import atomic
from illumcli.files.atomic import Part, write_bytes, write_text


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
    with Part(target) as part:
        part.path.write_text("new")
        assert target.read_text() == "old"
        assert part.path.parent == tmp_path
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
        with Part(tmp_path / "a.txt") as part:
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


@pytest.mark.parametrize("call", ["open", "fsync", "replace", "close", "scandir"])
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
    assert parts(tmp_path) == [] or call == "close"  # a refused close leaves it for the next run


def test_full_disk_while_writing_is_an_output_error(tmp_path):

    def fill():
        with Part(tmp_path / "a.txt"), open("/dev/full", "w") as full:
            full.write("text")

    with pytest.raises(OutputError, match="No space left on device; free some space"):
        fill()
    assert os.listdir(tmp_path) == []


def test_error_of_another_file_stays_what_it_is(tmp_path):
    with pytest.raises(FileNotFoundError), Part(tmp_path / "a.txt"):
        (tmp_path / "missing").read_text()
    assert os.listdir(tmp_path) == []


def test_parts_of_dead_processes_are_removed_and_no_others(tmp_path, monkeypatch):
    died = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True
    )
    target, host = tmp_path / "a.txt", atomic._host()
    dead = atomic.beside(target, f"{host}.{int(died.stdout)}.0123abcd.part")
    kept = [
        atomic.beside(target, f"{host}.{os.getpid()}.0123abcd.part"),  # of a live process
        atomic.beside(tmp_path / "b.txt", f"{host}.{int(died.stdout)}.0123abcd.part"),  # of another file
        tmp_path / ".a.txt.part",
    ]
    monkeypatch.setattr(atomic.os, "uname", lambda: os.uname_result(("", "elsewhere", "", "", "")))
    elsewhere = atomic._host()
    kept.append(atomic.beside(target, f"{elsewhere}.{int(died.stdout)}.0123abcd.part"))
    monkeypatch.undo()
    for path in (dead, *kept):
        path.write_text("half")
    write_text(tmp_path / "a.txt", "whole")
    assert not dead.exists()
    assert all(path.exists() for path in kept)


def test_killed_process_leaves_no_file_and_the_next_run_tidies_up(tmp_path):
    script = f"""
import os, signal
from illumcli.files.atomic import Part
with Part({str(tmp_path / "a.txt")!r}) as part:
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
        atomic.Part(tmp_path / "a.txt")
    assert len(os.listdir(tmp_path)) == 1
    atomic.discard_open()
    assert os.listdir(tmp_path) == []


def test_a_part_of_somebody_elses_process_is_kept(tmp_path, monkeypatch):
    def theirs(pid: int, number: int) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(atomic.os, "kill", theirs)
    part = atomic.beside(tmp_path / "a.txt", f"{atomic._host()}.1.0123abcd.part")
    part.write_text("half")
    write_text(tmp_path / "a.txt", "whole")
    assert part.exists()


def test_a_part_that_is_gone_already_is_discarded_too(tmp_path):
    part = Part(tmp_path / "a.txt")
    part.path.unlink()
    part.discard()
    assert not [path for path in atomic._open if path.parent == tmp_path]
