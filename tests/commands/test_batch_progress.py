"""How far a whole batch is, in one line; batches that find the disk full."""

from __future__ import annotations

import pytest

from illumcli.commands.batch import Batch
from illumcli.commands.runner import Here, Pieces
from illumcli.errors import IllumError, InputError
from illumcli.files.atomic import no_space_left, refused


def run_all(batch, run, kept=()):
    told = []
    runner = Here(lambda what, done, total: told.append((what, done, total)))
    pieces = Pieces(lambda number: None, lambda number: None, run, frozenset(kept))
    for number, result in runner.results(batch, pieces):
        with batch.piece(number):
            result()
    return told


def test_pieces_count_as_they_finish_fail_or_exist():
    def run(number, progress):
        if number == 2:
            raise InputError("no")
        progress("tiles", 1, 4)

    batch = Batch("variants", 5, True, lambda text: None)
    told = run_all(batch, run, kept=[0])
    assert told == [
        ("0 of 5 variants", 0, 4000),
        ("0 of 5 variants", 250, 4000),
        ("1 of 5 variants", 0, 4000),  # it existed
        ("1 of 5 variants", 250, 4000),
        ("2 of 5 variants", 1000, 4000),
        ("3 of 5 variants, 1 failed", 2000, 4000),
        ("3 of 5 variants, 1 failed", 2250, 4000),
        ("4 of 5 variants, 1 failed", 3000, 4000),
        ("4 of 5 variants, 1 failed", 3250, 4000),
        ("5 of 5 variants, 1 failed", 4000, 4000),
    ]


def test_a_single_piece_tells_of_itself():
    told = run_all(Batch("scenes", 1, True, lambda text: None), lambda number, progress: progress("a", 1, 4))
    assert told == [("a", 1, 4)]


def test_nothing_is_started_once_the_disk_is_full():
    started = []

    def run(number, progress):
        started.append(number)
        if number == 1:
            raise refused("out.png", no_space_left()) from no_space_left()

    batch = Batch("variants", 9, True, lambda text: None)
    run_all(batch, run)
    assert started == [0, 1]
    with pytest.raises(IllumError, match="1 of 9 variants failed; no space is left, so no others") as caught:
        batch.finish()
    assert caught.value.exit_code == 5
