"""Files known by what is in them: equal contents are equal, whatever their names and dates."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from illumcli.cache.fingerprint import FileFingerprint, file_digest
from illumcli.errors import InputError


def content(path: Path, *others: Path) -> FileFingerprint:
    return FileFingerprint(lambda: path, lambda found: others) if others else FileFingerprint(lambda: path)


def test_equal_contents_are_equal_whatever_their_names_and_dates(tmp_path):
    for name in "ab":
        (tmp_path / name).write_text("the same")
    os.utime(tmp_path / "a", (0, 0))
    (tmp_path / "c").write_text("the Same")
    a, b, c = (repr(content(tmp_path / name)) for name in "abc")
    assert a == b == f"Content({file_digest(tmp_path / 'a')})"
    assert a != c
    assert len(file_digest(tmp_path / "a")) == 32


def test_what_lies_beside_counts_by_name_and_content_and_by_its_absence(tmp_path):
    own, beside, moved = (tmp_path / name for name in ("own", "beside", "moved"))
    own.write_text("own")
    seen = {content(own).digest, content(own, beside).digest}
    beside.write_text("one")
    seen.add(content(own, beside).digest)
    beside.write_text("two")
    seen.add(content(own, beside).digest)
    beside.rename(moved)
    seen.add(content(own, moved).digest)
    assert len(seen) == 5
    assert {len(digest) for digest in seen} == {32}


def test_a_change_is_seen_once_the_content_was_asked_for(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    known = content(path)
    assert not known.has_changed
    path.write_text("new")
    assert not known.has_changed  # never asked for
    first = known.digest
    assert not known.has_changed
    path.write_text("newer")
    assert known.has_changed
    assert known.digest == first


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none: no such file or directory; check the path"):
        file_digest(tmp_path / "none")
    with pytest.raises(InputError, match="is a directory; check the path"):
        file_digest(tmp_path)
