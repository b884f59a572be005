"""Descriptions: what they take, what they refuse, and what can be done with them."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import pytest
from pydantic_core import ValidationError

from illumcli.schema.description import REQUIRED, Description, checks, written
from illumcli.schema.fields import Many, Positive, Text, Three, Within, marks, schema_of


class Lens(Description):
    kind: Literal["lens"]
    focus: Positive = 0.05


class Body(Description):
    serial: Annotated[str, Text(r"^[0-9]+$", longest=4)] | None = None
    lens: Lens = written({"kind": "lens"})
    stops: Annotated[tuple[Positive, ...], Many(least=1, most=2)] = (2.0,)
    makers: ClassVar[str] = "of no field"

    def check(self) -> None:
        if self.serial == "13":
            raise ValueError("13 brings bad luck")


class Zoom(Body):
    serial: Annotated[str, Text(r"^[0-9]+$")]  # here it must be said
    shortest: Positive = 1.0
    longest: Positive = 0.5

    @checks("longest")
    def _longer(longest: float, before: Mapping[str, Any]) -> None:
        if longest <= before.get("shortest", 0):
            raise ValueError("must be longer than shortest")


def kinds(cls: type[Description], value: Any) -> dict[tuple[str | int, ...], str]:
    with pytest.raises(ValidationError) as caught:
        cls.validated(value)
    return {each["loc"]: each["type"] for each in caught.value.errors()}


def test_what_is_not_said_is_its_default_made_anew():
    first, second = Body(), Body.validated({})
    assert first == second
    assert first.lens == Lens(kind="lens", focus=0.05)
    assert first.lens is not second.lens
    assert first.stops == (2.0,)


def test_text_is_no_number_and_a_list_becomes_a_tuple():
    assert Body(stops=[2, 4]).stops == (2.0, 4.0)
    assert kinds(Body, {"stops": [1, "2"]}) == {("stops", 1): "float_type"}
    assert kinds(Body, {"stops": [1, 2, 3]}) == {("stops",): "too_long"}
    assert kinds(Body, {"serial": "12345"}) == {("serial",): "string_too_long"}


def test_every_fault_is_said_at_once_with_its_place():
    assert kinds(Body, {"lens": {"focus": 0}, "colour": 1}) == {
        ("lens", "kind"): "missing",
        ("lens", "focus"): "greater_than",
        ("colour",): "extra_forbidden",
    }
    assert kinds(Body, {"lens": 3}) == {("lens",): "dict_type"}


def test_the_class_that_refused_a_mapping_is_noted():
    tree, classes = {"lens": {"kind": "lens", "foucs": 1}}, {}
    with pytest.raises(ValidationError):
        Body.validated(tree, classes)
    assert classes == {id(tree["lens"]): Lens, id(tree): Body}


def test_fields_that_do_not_go_together_are_refused():
    assert kinds(Body, {"serial": "13"}) == {(): "value_error"}
    assert kinds(Zoom, {"serial": "1"}) == {("longest",): "value_error"}  # a default is looked at too
    assert kinds(Zoom, {"serial": "1", "shortest": -1}) == {("shortest",): "greater_than"}
    assert Zoom(serial="1", longest=2).longest == 2


def test_fields_come_in_the_order_of_the_classes_and_the_last_one_rules():
    assert list(Zoom.fields()) == ["serial", "lens", "stops", "shortest", "longest"]
    assert Body.fields()["serial"].default is None
    assert Zoom.fields()["serial"].default is REQUIRED
    assert kinds(Zoom, {"longest": 2}) == {("serial",): "missing"}


def test_a_description_is_frozen_and_a_changed_one_is_another():
    body = Body()
    with pytest.raises(AttributeError, match="frozen"):
        body.serial = "2"
    with pytest.raises(AttributeError, match="frozen"):
        del body.serial
    changed = body.replaced(serial="2")
    assert (changed.serial, body.serial) == ("2", None)
    assert changed != body
    assert changed != dict(changed)
    assert len({body, Body(), changed}) == 2


def test_it_goes_to_another_process_and_names_itself():
    body = Body(serial="7")
    assert pickle.loads(pickle.dumps(body)) == body
    assert repr(body.lens) == "Lens(kind='lens', focus=0.05)"


def test_the_marks_of_an_annotation_are_found_from_the_inside_out():
    kind = Annotated[Annotated[float, Within(ge=0)] | None, Three(Within(ge=1))]
    assert list(marks(kind)) == [Within(ge=0), Three(Within(ge=1))]


def test_a_field_that_can_hold_nothing_known_is_a_mistake_of_the_program():
    with pytest.raises(TypeError, match="may hold"):
        schema_of(complex)
