"""Files that exist already: equal, different, incomplete; and obstacles to writing new ones."""

from __future__ import annotations

import errno
import os
import re

import pytest

from illumcli.baking.files import baked_contents
from illumcli.errors import InputError, OutputError
from illumcli.files import outputs
from illumcli.files.atomic import beside
from illumcli.files.outputs import INCOMPLETE, is_kept, refresh, refuse_suffix
from illumcli.files.reports import report_contents, sealed_csv, sealed_json
from illumcli.files.seal import BLANK, sealed_text
from illumcli.images.contents import image_contents
from illumcli.images.writer import ImageWriter


def table(*contents):
    return sealed_csv(["a", "content", "seconds"], [(1, content, 0.5) for content in contents])


TWO = {
    "t.csv": table("one", "two"),
    "t.json": sealed_json([{"content": "one", "seconds": 3}, {"content": "two"}], in_a_list=True),
}
ONE = {
    "t.json": sealed_json([{"content": "one"}], in_a_list=False),
    "t.svg": sealed_text(f"<svg><dc:identifier>one</dc:identifier>{BLANK}</svg>"),
}


@pytest.mark.parametrize(("name", "text"), TWO.items())
def test_a_file_of_equal_contents_is_kept_and_no_other(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    assert is_kept(path, ["one", "two"], report_contents)
    assert not is_kept(path, ["one", "two"], report_contents, force=True)
    for contents in (["one"], ["two", "one"], ["one", "three"], ["one", "two", "three"], [INCOMPLETE, "two"]):
        with pytest.raises(OutputError, match="a different file is there; use --force"):
            is_kept(path, contents, report_contents)
        assert not is_kept(path, contents, report_contents, force=True)


@pytest.mark.parametrize(("name", "text"), ONE.items())
def test_the_content_of_one_thing(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    assert is_kept(path, ["one"], report_contents)
    with pytest.raises(OutputError):
        is_kept(path, ["two"], report_contents)


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_images_say_their_content(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    kind = {"png": "uint8", "exr": "half"}[suffix]
    import numpy as np

    with ImageWriter(path, 2, 2, {"Y": kind}, {"illum:content": "one"}) as writer:
        writer.write_band(0, np.zeros((2, 2, 1), np.uint8 if suffix == "png" else np.float32))
    assert is_kept(path, ["one"], image_contents)
    with pytest.raises(OutputError):
        is_kept(path, ["two"], image_contents)


def test_a_file_that_cannot_be_read_is_told_so(tmp_path, monkeypatch):
    def refuse(path):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    path = tmp_path / "p.png"
    path.write_bytes(b"")
    monkeypatch.setattr(outputs, "is_sealed", refuse)
    with pytest.raises(OutputError, match="cannot be read: Permission denied; use --force"):
        is_kept(path, ["one"], image_contents)
    assert not is_kept(path, ["one"], image_contents, force=True)


def test_what_was_incomplete_is_replaced(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(table("one", INCOMPLETE))
    assert not is_kept(path, ["one", "two"], report_contents)
    assert not is_kept(path, ["one", INCOMPLETE], report_contents)
    with pytest.raises(OutputError):
        is_kept(path, ["three", "two"], report_contents)


@pytest.mark.parametrize(
    ("suffix", "read"),
    [
        *((suffix, report_contents) for suffix in ("csv", "json", "svg", "txt")),
        *((suffix, image_contents) for suffix in ("png", "exr", "txt")),
        *((suffix, baked_contents) for suffix in ("npz", "ply", "glb", "txt")),
    ],
)
@pytest.mark.parametrize("data", [b"", b"\xff\0", b"[1, 2]", b"{}", b"a,b\n1\n", b'{"content": 3}'])
def test_files_of_others_are_never_replaced(tmp_path, suffix, read, data):
    path = tmp_path / f"t.{suffix}"
    path.write_bytes(data)
    with pytest.raises(OutputError, match="a different file is there"):
        is_kept(path, ["one"], read)


def test_nothing_is_made_by_looking(tmp_path):
    assert not is_kept(tmp_path / "x" / "y" / "t.csv", ["one"], report_contents)
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.csv").mkdir()
    long = "n" * 300
    for name, fact in (
        ("file/t.csv", "part of the path is a file"),
        ("file/x/t.csv", "part of the path is a file"),
        ("folder.csv", "is a folder or a device"),
        (f"{long}.csv", "shorten the name"),
        (f"new/{long}/t.csv", "shorten the name"),
        (f"{long}/t.csv", "shorten the name"),
    ):
        for force in (False, True):
            with pytest.raises(OutputError, match=re.escape(str(tmp_path / name)) + f": .*{fact}"):
                is_kept(tmp_path / name, ["one"], report_contents, force)
    with pytest.raises(OutputError, match="is a folder or a device"):
        is_kept(outputs.Path("/dev/null"), ["one"], report_contents, True)


def test_a_folder_that_is_read_only_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(outputs.os, "access", lambda path, mode: False)
    with pytest.raises(OutputError, match="Permission denied; choose a folder you may write to"):
        is_kept(tmp_path / "new" / "t.csv", ["one"], report_contents)


def test_suffixes():
    refuse_suffix(outputs.Path("a.CSV"), "a table", ".csv")
    with pytest.raises(InputError, match=r"a\.txt: a table is written as \.csv or \.json; let"):
        refuse_suffix(outputs.Path("a.txt"), "a table", ".csv", ".json")


def test_a_file_that_is_kept_is_dated_now(tmp_path):
    path = tmp_path / "a"
    path.write_text("")
    os.utime(path, (1e9, 1e9))
    refresh(path)
    assert path.stat().st_mtime > 1.5e9
    refresh(tmp_path / "none")


def test_a_link_to_nothing_makes_no_file_elsewhere_unless_it_is_asked_for(tmp_path):
    (tmp_path / "a.png").symlink_to(tmp_path / "elsewhere.png")
    with pytest.raises(OutputError, match=r"a.png: is a link to nothing; use --force"):
        is_kept(tmp_path / "a.png", ["one"], report_contents)
    assert not is_kept(tmp_path / "a.png", ["one"], report_contents, force=True)


def test_a_run_that_keeps_all_tidies_up_too(tmp_path):
    (tmp_path / "a.json").write_text(TWO["t.json"])
    left = beside(tmp_path / "b.json", "0123abcd.part")
    left.write_text("half")
    refresh(tmp_path / "a.json")
    assert os.listdir(tmp_path) == ["a.json"]
