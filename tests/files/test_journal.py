"""A journal holds whole records of one computation, for one process at a time."""

from __future__ import annotations

import errno
import os

import pytest

from illumcli.files import atomic, journal
from illumcli.files.journal import Journal, place, tidy

OWN, OTHER = "a" * 32, "b" * 32
KEYS = [bytes([number]) * 16 for number in range(3)]


def filled(path, identity=OWN):
    made = Journal(path, identity)
    for key in KEYS:
        made.append(key, key * 9)
    made.close()


def test_records_are_found_again_and_those_of_another_computation_are_not(tmp_path):
    path = place(tmp_path / "out.npz", OWN)
    filled(path)
    again = Journal(path, OWN)
    assert [again.find(key) for key in KEYS] == [key * 9 for key in KEYS]
    assert again.find(b"x" * 16) is None
    again.close()
    assert path.stat().st_mode & 0o777 == 0o600
    other = Journal(path, OTHER)
    assert [other.find(key) for key in KEYS] == [None] * 3
    other.close()
    assert os.listdir(tmp_path) == []  # there is nothing to take up


def test_a_record_that_is_cut_or_changed_is_not_found_and_the_others_are(tmp_path):
    path = place(tmp_path / "out.npz", OWN)
    filled(path)
    whole = path.read_bytes()
    for at in range(len(whole)):
        path.write_bytes(whole[:at])
        cut = Journal(path, OWN)
        found = [cut.find(key) for key in KEYS]
        expected = [key * 9 for key in KEYS]
        count = sum(each is not None for each in found)
        assert found == expected[:count] + [None] * (3 - count)
        assert cut.refusal is None
        for key in KEYS[count:]:
            cut.append(key, key * 9)
        cut.close()
        assert path.read_bytes() == whole
    at = whole.index(KEYS[1] * 9)
    path.write_bytes(whole[:at] + b"?" + whole[at + 1 :])
    changed = Journal(path, OWN)
    assert [changed.find(key) is None for key in KEYS] == [False, True, False]
    changed.remove()
    assert os.listdir(tmp_path) == []


def test_one_process_at_a_time_holds_it(tmp_path):
    path = place(tmp_path / "out.npz", OWN)
    filled(path)
    first, second = Journal(path, OWN), Journal(path, OWN)
    assert second.refusal is not None
    assert second.find(KEYS[0]) is None
    second.append(KEYS[0], b"wrong")
    second.remove()
    tidy(tmp_path / "out.npz")
    assert path.exists()
    assert first.find(KEYS[0]) == KEYS[0] * 9
    first.close()
    tidy(tmp_path / "other.npz")
    assert path.exists()
    tidy(tmp_path / "out.npz")
    assert not path.exists()


@pytest.mark.parametrize("call", ["pwrite", "ftruncate", "pread", "open"])
def test_a_refused_call_costs_the_journal_alone(tmp_path, monkeypatch, call):
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr((atomic if call == "open" else journal).os, call, refuse)
    made = Journal(place(tmp_path / "out.npz", OWN), OWN)
    made.append(KEYS[0], b"values")
    monkeypatch.undo()
    assert made.refusal == "No space left on device"
    assert made.find(KEYS[0]) is None
    made.close()
    assert os.listdir(tmp_path) == []
