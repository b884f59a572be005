"""Works that are held between planning and rendering."""

from __future__ import annotations

from illumcli.commands import held_works
from illumcli.commands.held_works import HeldWorks


def test_each_work_is_prepared_once_more_at_most(monkeypatch):
    monkeypatch.setattr(held_works, "HELD", 3)
    prepared = []
    works = HeldWorks(lambda number: prepared.append(number) or f"work {number}")
    assert [works.of(number) for number in range(6)] == [f"work {number}" for number in range(6)]
    assert prepared == [0, 1, 2, 3, 4, 5]

    # Each is done while the next one is looked at.
    for number in range(6):
        assert works.of(number) == f"work {number}"
        works.of(min(number + 1, 5))
        works.drop(number)
    assert prepared[6:] == [2, 3, 4]


def test_works_that_are_never_done_leave_room_for_others(monkeypatch):
    monkeypatch.setattr(held_works, "HELD", 3)
    prepared = []
    works = HeldWorks(lambda number: prepared.append(number) or number)
    for number in range(6):  # planned, but left to other processes
        works.of(number)
    for number in range(6, 9):
        works.of(number)
        works.of(number + 1)
        works.drop(number)
    assert prepared[6:] == [6, 7, 8, 9]
