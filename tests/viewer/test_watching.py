"""Files on disk whose change is noticed."""

from __future__ import annotations

import os

import pytest

from illumcli.viewer import watching
from illumcli.viewer.watching import Watch


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setattr(watching, "PERIOD", 0)
    path = tmp_path / "scene.yaml"
    path.write_text("version: 1\n")
    return path


def looks(watch):
    """What the next looks say."""
    return [watch.have_changed() for _ in range(3)]


def test_a_file_that_is_written_counts_once_it_rests(file):
    watch = Watch()
    watch.add([file])
    assert looks(watch) == [False, False, False]
    file.write_text("version: 1\nambient: 1\n")
    assert not watch.have_changed()  # it may be written still
    file.write_text("version: 1\nambient: 1\nseed: 1\n")
    assert looks(watch) == [False, True, True]
    watch.begin()
    assert looks(watch) == [False, False, False]


def test_a_file_that_is_replaced_counts_whatever_its_time(file):
    watch = Watch()
    watch.add([file])
    other = file.with_name("other")
    other.write_text("version: 2\n")
    about = file.stat()
    os.utime(other, ns=(about.st_atime_ns, about.st_mtime_ns))
    other.replace(file)
    assert looks(watch) == [False, True, True]


def test_files_that_vanish_or_come_count(file):
    absent = file.with_name("mesh.obj")
    watch = Watch()
    watch.add([file, absent])
    absent.write_text("v 0 0 0\n")
    assert looks(watch) == [False, True, True]
    watch.begin()
    absent.unlink()
    assert looks(watch) == [False, True, True]
    absent.write_text("v 0 0 0\n")
    file.unlink()
    watch.begin()
    file.write_text("version: 1\n")
    assert looks(watch) == [False, True, True]


def test_it_looks_seldom(file, monkeypatch):
    monkeypatch.setattr(watching, "PERIOD", 1e9)
    watch = Watch()
    watch.add([file])
    file.write_text("more\n")
    assert looks(watch) == [False, False, False]
