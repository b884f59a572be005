"""Units of work of a bake: their keys, the threads that compute them, and how they end."""

from __future__ import annotations

import pickle
import threading
from itertools import pairwise

import numpy as np
import pytest

from illumcli.baking.work import WorkUnit, run_units
from illumcli.progress import no_progress


def unit(points=(3, 4, 9), samples=16, number=0):
    return WorkUnit(np.array(points), samples, number)


def rays_of(each, stop):
    return each.rays


def test_a_key_tells_units_apart_and_nothing_else():
    different = [unit(), unit(samples=17), unit(number=1), unit(points=(3, 4)), unit(points=(4, 3, 9))]
    assert len({each.key() for each in different}) == len(different)
    assert unit().key() == unit(points=np.arange(10)[[3, 4, 9]]).key()
    assert unit().key() == WorkUnit(np.array([3, 0, 4, 0, 9])[::2], 16, 0).key()
    assert len(unit().key()) == 16


def test_a_unit_is_the_same_in_another_process():
    there = pickle.loads(pickle.dumps(unit()))
    assert (there.key(), there.rays) == (unit().key(), 48)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_every_unit_is_computed_once_and_told_by_its_index(threads):
    units = [unit(points=range(k + 1)) for k in range(20)]
    told = []
    results = list(run_units("rays", units, rays_of, threads, lambda *what: told.append(what)))
    assert sorted(results) == [(k, 16 * (k + 1)) for k in range(20)]
    assert told[-1] == ("rays", 16 * 210, 16 * 210)
    assert len(told) == 20
    assert all(first[1] < second[1] for first, second in pairwise(told))


def test_no_units_are_nothing():
    assert list(run_units("rays", [], rays_of, 2, no_progress)) == []


def test_units_in_flight_are_told_when_the_consumer_stops():
    started, stopped = threading.Semaphore(0), []

    def compute(each, stop):
        if each.object:
            started.release()
            stopped.append(stop.wait(20))
        else:
            assert started.acquire(timeout=20)
        return each.object

    results = run_units("rays", [unit(number=k) for k in (1, 0, 1, 1)], compute, 2, no_progress)
    assert next(results) == (1, 0)
    results.close()
    assert stopped
    assert all(stopped)


def test_the_error_of_a_unit_is_raised():
    def compute(each, stop):
        raise MemoryError(f"object {each.object}")

    with pytest.raises(MemoryError, match="object 7"):
        list(run_units("rays", [unit(number=7)], compute, 2, no_progress))
