"""Descriptions: accepted and refused values, and their methods."""

from __future__ import annotations

import pickle
from typing import Annotated, Any, ClassVar, Literal, Self

import pytest
from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator

from illumcli.schema.description import Description, default_of
from illumcli.schema.fields import ListOf, Name, Positive


class Lens(Description):
    kind: Literal["lens"]
    focus: Positive = 0.05


class Body(Description):
    serial: Annotated[str, Field(pattern=r"^[0-9]+$", max_length=4)] | None = None
    lens: Lens = default_of({"kind": "lens"})
    stops: Annotated[ListOf[Positive], Field(min_length=1, max_length=2)] = (2.0,)
    sealed: bool = False
    makers: ClassVar[str] = "of no field"

    @model_validator(mode="after")
    def _lucky(self) -> Self:
        if self.serial == "13":
            raise ValueError("13 brings bad luck")
        return self


class Zoom(Body):
    serial: Annotated[str, Field(pattern=r"^[0-9]+$")]  # here it must be given
    shortest: Positive = 1.0
    longest: Positive = 0.5

    @field_validator("longest")
    @classmethod
    def _longer(cls, longest: float, info: ValidationInfo) -> float:
        if longest <= info.data.get("shortest", 0):
            raise ValueError("must be longer than shortest")
        return longest


def kinds(cls: type[Description], value: Any) -> dict[tuple[str | int, ...], str]:
    with pytest.raises(ValidationError) as caught:
        cls.model_validate(value)
    return {each["loc"]: each["type"] for each in caught.value.errors()}


def test_fields_that_are_left_out_have_their_defaults():
    body = Body.model_validate({})
    assert body == Body()
    assert body.lens == Lens(kind="lens", focus=0.05)
    assert body.stops == (2.0,)


def test_text_is_no_number_a_number_no_flag_and_a_list_becomes_a_tuple():
    assert Body(stops=[2, 4]).stops == (2.0, 4.0)
    assert kinds(Body, {"stops": [1, "2"]}) == {("stops", 1): "float_type"}
    assert kinds(Body, {"stops": [1, float("nan")]}) == {("stops", 1): "finite_number"}
    assert kinds(Body, {"stops": [1, 2, 3]}) == {("stops",): "too_long"}
    assert kinds(Body, {"serial": "12345"}) == {("serial",): "string_too_long"}
    assert kinds(Body, {"sealed": 1}) == {("sealed",): "bool_type"}


def test_every_fault_is_reported_at_once_with_its_place():
    assert kinds(Body, {"lens": {"focus": 0}, "colour": 1}) == {
        ("lens", "kind"): "missing",
        ("lens", "focus"): "greater_than",
        ("colour",): "extra_forbidden",
    }
    assert kinds(Body, {"lens": 3}) == {("lens",): "model_type"}


def test_fields_that_do_not_go_together_are_refused():
    assert kinds(Body, {"serial": "13"}) == {(): "value_error"}
    assert kinds(Zoom, {"serial": "1"}) == {("longest",): "value_error"}  # a default is looked at too
    assert kinds(Zoom, {"serial": "1", "shortest": -1}) == {("shortest",): "greater_than"}
    assert Zoom(serial="1", longest=2).longest == 2


def test_a_description_is_frozen_and_a_changed_one_is_another():
    body = Body()
    with pytest.raises(ValidationError, match="frozen"):
        body.serial = "2"
    with pytest.raises(ValidationError, match="frozen"):
        del body.serial
    changed = body.model_copy(update={"serial": "2"})
    assert (changed.serial, body.serial) == ("2", None)
    assert changed != body
    assert len({body, Body(), changed}) == 2


def test_it_goes_to_another_process_and_names_itself():
    body = Body(serial="7")
    assert pickle.loads(pickle.dumps(body)) == body
    assert repr(body.lens) == "Lens(kind='lens', focus=0.05)"


class Named(Description):
    name: Name


@pytest.mark.parametrize("text", ["1a", "-a", "a b", "", "a\n"])
def test_a_name_has_letters_digits_and_dashes(text):
    assert kinds(Named, {"name": text}) == {("name",): "value_error"}
    assert Named(name="a-1").name == "a-1"
