"""Frozen records behave as the standard library's frozen data classes do."""

from __future__ import annotations

import pickle
from dataclasses import field, fields, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from illumcli.records import Record, Value


class Place(Value):
    x: int
    y: int = 0
    notes: dict[str, Any] = field(default_factory=dict, repr=False)
    unit: ClassVar[str] = "m"


class Named(Place):
    name: str = "here"

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("must have a name")


class Arrays(Record):
    values: np.ndarray


def test_fields_are_given_by_place_or_by_name():
    assert Place(1, 2) == Place(y=2, x=1)
    assert (Place(1).y, Place(1).notes) == (0, {})
    assert Place(1).notes is not Place(1).notes
    assert [part.name for part in fields(Named)] == ["x", "y", "notes", "name"]
    assert Named(1, name="there").name == "there"


@pytest.mark.parametrize(
    ("values", "named", "said"),
    [
        ((), {}, "missing field x"),
        ((1,), {"z": 2}, "takes x, y, notes"),
        ((1, 2, {}, 4), {}, "takes"),
        ((1,), {"x": 2}, "takes"),
    ],
)
def test_fields_that_are_missing_strange_or_given_twice_are_refused(values, named, said):
    with pytest.raises(TypeError, match=said):
        Place(*values, **named)


def test_nothing_can_be_changed_but_a_changed_one_can_be_made():
    place = Named(1)
    with pytest.raises(AttributeError, match="frozen"):
        place.x = 2
    with pytest.raises(AttributeError, match="frozen"):
        del place.x
    assert replace(place, x=2) == Named(2)
    with pytest.raises(ValueError, match="name"):
        replace(place, name="")


def test_equal_parts_make_equal_values_of_one_class():
    assert Place(1) != Named(1)
    assert {Place(1, notes=()), Place(1, notes=()), Place(2, notes=())} == {
        Place(1, notes=()),
        Place(2, notes=()),
    }
    assert repr(Place(1)) == "Place(x=1, y=0)"
    assert pickle.loads(pickle.dumps(Place(3, 4))) == Place(3, 4)


def test_records_of_arrays_are_equal_to_themselves_alone():
    first, second = Arrays(np.zeros(2)), Arrays(np.zeros(2))
    assert first == first
    assert first != second
    assert len({first, second}) == 2
