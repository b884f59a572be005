"""Values written as YAML are read as the same values."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.scene import source
from illumcli.scene.yaml_text import block, flow

TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=8)
SCALARS = st.one_of(st.none(), st.booleans(), st.integers(-(10**9), 10**9), st.floats(-1e18, 1e18), TEXT)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=8,
)


def read(text):
    node, problems = source.read(text.encode(), "written")
    assert not problems, text
    return node.plain()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ({"a": [1, 0.5, True, None], "b": {"c": "x y"}}, '{a: [1, 0.5, true, null], b: {c: "x y"}}'),
        ("null", '"null"'),
        ("plain/name.obj", "plain/name.obj"),
        ("é", '"é"'),
        ("3", '"3"'),
        ((1, 2), "[1, 2]"),
    ],
)
def test_values_on_one_line(value, text):
    assert flow(value) == text


@given(VALUES)
def test_a_line_is_read_as_its_value(value):
    assert read(flow(value)) == value


@given(st.dictionaries(TEXT, VALUES, min_size=1, max_size=4))
def test_a_block_is_read_as_its_mapping(mapping):
    assert read(block(mapping)) == mapping


def test_a_block_has_a_line_for_each_part():
    clay = {"model": "phong", "diffuse": [0.5, 0.5, 0.5]}
    assert block({"extends": "a.yaml", "materials": {"clay": clay, "wax": clay}, "lights": [clay]}) == (
        "extends: a.yaml\n"
        "materials:\n"
        "  clay: {model: phong, diffuse: [0.5, 0.5, 0.5]}\n"
        "  wax: {model: phong, diffuse: [0.5, 0.5, 0.5]}\n"
        "lights:\n"
        "  - {model: phong, diffuse: [0.5, 0.5, 0.5]}\n"
    )
