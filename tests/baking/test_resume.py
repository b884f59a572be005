"""Units of a bake in its journal: the same bits again, and none that belong to something else."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from illumcli.baking import resume
from illumcli.baking.resume import load_unit, open_journal, store_unit, write_beside
from illumcli.baking.work import WorkUnit
from illumcli.errors import OutputError
from illumcli.visibility.obscurance_error import Estimates

UNIT = WorkUnit(np.array([5, 1, 2]), 16, 0)


def estimates(bent=False, seed=None):
    """Of 6 points: random ones, or NaN that is to be filled in."""
    shape = (6, 5)
    values = np.full(shape, np.nan) if seed is None else np.random.default_rng(seed).random(shape)
    values = values.astype(np.float32)
    return Estimates(values[:, 0].copy(), values[:, 1].copy(), values[:, 2:].copy() if bent else None)


@pytest.fixture
def journal(tmp_path):
    opened = open_journal(tmp_path / "out.npz", "ab" * 16)
    yield opened
    opened.close()


@pytest.mark.parametrize("bent", [False, True])
def test_a_unit_comes_back_bit_by_bit(tmp_path, bent):
    with_values, empty = estimates(bent, seed=3), estimates(bent)
    first = open_journal(tmp_path / "out.npz", "ab" * 16)
    store_unit(first, UNIT, with_values, 123_456_789_012)
    first.close()
    again = open_journal(tmp_path / "out.npz", "ab" * 16)
    assert load_unit(again, UNIT, empty) == 123_456_789_012
    again.close()
    for name in ("w", "neighbor_variation", *(["bent"] if bent else [])):
        before, after = getattr(with_values, name), getattr(empty, name)
        assert after[[5, 1, 2]].tobytes() == before[[5, 1, 2]].tobytes()
        assert np.isnan(after[[0, 3, 4]]).all()


def test_other_units_are_not_there(journal):
    store_unit(journal, UNIT, estimates(seed=3), 48)
    for other in (
        WorkUnit(UNIT.points, 17, 0),
        WorkUnit(UNIT.points[::-1], 16, 0),
        WorkUnit(UNIT.points, 16, 1),
    ):
        empty = estimates()
        assert load_unit(journal, other, empty) is None
        assert np.isnan(empty.w).all()


def test_a_unit_without_bent_normals_is_none_with_them(journal):
    store_unit(journal, UNIT, estimates(seed=3), 48)
    assert load_unit(journal, UNIT, estimates(bent=True)) is None


def test_units_of_another_computation_are_not_read(tmp_path):
    first = open_journal(tmp_path / "out.npz", "ab" * 16)
    store_unit(first, UNIT, estimates(seed=3), 48)
    first.close()
    other = open_journal(tmp_path / "out.npz", "cd" * 16)
    assert load_unit(other, UNIT, estimates()) is None
    other.close()


def test_units_of_another_version_of_the_code_are_not_read(tmp_path, monkeypatch):
    first = open_journal(tmp_path / "out.npz", "ab" * 16)
    store_unit(first, UNIT, estimates(seed=3), 48)
    first.close()
    monkeypatch.setattr(resume, "code", lambda: "another")
    other = open_journal(tmp_path / "out.npz", "ab" * 16)
    assert load_unit(other, UNIT, estimates()) is None
    other.close()


class Full:
    """A write that finds the disk full until the journal is gone."""

    def __init__(self, number, failures):
        self.number, self.failures, self.calls = number, failures, 0

    def __call__(self):
        self.calls += 1
        if self.calls > self.failures:
            return "written"
        try:
            raise OSError(self.number, "no")
        except OSError as error:
            raise OutputError("out.npz: no") from error


def test_a_full_disk_costs_the_journal_and_not_the_bake(tmp_path, journal):
    store_unit(journal, UNIT, estimates(seed=3), 48)
    write = Full(errno.ENOSPC, 1)
    assert len(list(tmp_path.glob(".*unfinished"))) == 1
    assert (write_beside(journal, write), write.calls) == ("written", 2)
    assert list(tmp_path.glob(".*unfinished")) == []


@pytest.mark.parametrize(("number", "failures", "calls"), [(errno.EACCES, 1, 1), (errno.ENOSPC, 2, 2)])
def test_other_refusals_are_raised(journal, number, failures, calls):
    write = Full(number, failures)
    with pytest.raises(OutputError):
        write_beside(journal, write)
    assert write.calls == calls
