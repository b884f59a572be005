"""Annotations: the part of a description at an error's location, choices, ranges."""

from __future__ import annotations

from typing import Annotated

import pytest
from pydantic import Field

from illumcli.models.cook_torrance import CookTorrance
from illumcli.models.phong import Phong
from illumcli.scene.spec import MeshFile, Perspective, Scene
from illumcli.schema.annotations import Range, choices, field_annotation, inside, number_range, split
from illumcli.schema.fields import LARGEST


def test_an_annotation_is_split_from_none_and_its_marks():
    rule = Field(ge=0)
    assert split(Annotated[float, rule] | None) == (float, (rule,))
    assert split(Annotated[Annotated[float, rule] | None, 1]) == (float, (rule, 1))
    assert split(int | float) == (int | float, ())


def test_a_step_inside_is_a_key_an_index_or_the_choice_of_a_union():
    cameras = field_annotation(Scene, "cameras")
    camera, is_part = inside(cameras, {"a": {}}, "a")
    assert is_part
    assert inside(camera, {}, "perspective")[1] is False
    assert split(inside(camera, {}, "perspective")[0])[0] is Perspective
    assert split(inside(field_annotation(Scene, "objects"), [{}], 0)[0])[0].__name__ == "Object"
    assert inside(Scene, {}, "unknown") == (None, True)
    assert inside(None, {}, "anything") == (None, True)


def test_of_a_family_the_member_that_is_named_or_meant():
    materials = field_annotation(Scene, "materials")
    for model in ("phong", "phng"):
        material, _ = inside(materials, {}, "a")
        exponent, is_part = inside(material, {"model": model}, "exponent")
        assert (exponent, is_part) == (field_annotation(Phong, "exponent"), True)


def test_choices_of_literals_and_of_unions():
    assert [tag for tag, _ in choices(field_annotation(MeshFile, "materials"))] == []
    assert [tag for tag, _ in choices(field_annotation(Scene, "terminator"))] == ["smooth", "none"]
    assert [tag for tag, _ in choices(field_annotation(CookTorrance, "fresnel"))][:2] == [
        "dielectric",
        "conductor",
    ]


def test_ranges_of_numbers_and_colors_that_may_vary():
    assert number_range(field_annotation(Phong, "diffuse")) == Range(0, None, LARGEST, None, 3)
    assert number_range(field_annotation(Phong, "exponent")) == Range(0, None, LARGEST, None, 1)
    assert number_range(field_annotation(CookTorrance, "diffuse_weight")) == Range(0, None, 1, None, 1)
    assert number_range(field_annotation(Perspective, "fov")) == Range(None, 0, None, 180, 1)
    with pytest.raises(LookupError, match="holds no number"):
        number_range(field_annotation(MeshFile, "file"))
