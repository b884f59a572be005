"""Fingerprints of files: equal for equal contents, whatever their names and dates."""

from __future__ import annotations

import os
from dataclasses import field
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.cache.fingerprint import FileFingerprint, digest, file_digest, fingerprint
from illumcli.errors import InputError
from illumcli.models.lambert import Lambert
from illumcli.records import Value


def content(path: Path, *others: Path) -> FileFingerprint:
    return FileFingerprint(lambda: path, lambda found: others) if others else FileFingerprint(lambda: path)


def test_equal_contents_are_equal_whatever_their_names_and_dates(tmp_path):
    for name in "ab":
        (tmp_path / name).write_text("the same")
    os.utime(tmp_path / "a", (0, 0))
    (tmp_path / "c").write_text("the Same")
    a, b, c = (fingerprint(content(tmp_path / name)) for name in "abc")
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


def stage(scene, hits):
    return scene, hits


def test_a_repr_reads_no_file(tmp_path):
    assert "gone" not in repr(content(tmp_path / "gone"))
    with pytest.raises(InputError, match="gone: no such file"):
        fingerprint((1, {"file": content(tmp_path / "gone")}))


def test_functions_are_known_by_their_name_and_what_is_bound(tmp_path):
    (tmp_path / "a").write_text("the content")
    bound = partial(stage, content(tmp_path / "a"), hits=3)
    text = f"Content({file_digest(tmp_path / 'a')})"
    assert fingerprint(bound) == f"(stage, ({text}), (('hits', 3)))"
    assert fingerprint(partial(partial(stage, 1), hits=2)) == fingerprint(partial(stage, 1, hits=2))
    assert fingerprint(content(tmp_path / "a").digest) != fingerprint(bound)


nested = st.recursive(st.integers() | st.text() | st.none() | st.booleans(), st.lists, max_leaves=6)


@given(nested, nested)
def test_equal_texts_are_equal_values(a, b):
    same = repr(a) == repr(b)  # 1 == True, but the one is no fingerprint of the other
    assert (fingerprint(a) == fingerprint(b)) == same
    assert fingerprint([a]) != fingerprint(a)
    assert fingerprint([a, b]) != fingerprint([[a, b]])


def test_records_show_what_their_repr_shows():
    class Pair(Value):
        a: int
        b: object = field(default=None, repr=False)

    assert fingerprint(Pair(1, object())) == fingerprint(Pair(1)) == "Pair{'a': 1}"
    assert fingerprint(Lambert(diffuse=(0.5, 0.5, 0.5))) != fingerprint(Lambert())
    assert fingerprint(Lambert()).startswith("Lambert{")


@pytest.mark.parametrize("value", [np.zeros(3), object(), {1, 2}], ids=["array", "object", "set"])
def test_what_has_no_text_of_its_own_is_refused(value):
    with pytest.raises(TypeError, match="has no fingerprint"):
        fingerprint((1, value))
    with pytest.raises(TypeError, match="has no fingerprint"):
        digest(value)
