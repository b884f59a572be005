"""The topological order of generated graphs."""

from __future__ import annotations

from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.graph import Node, required, topological_order


@st.composite
def books(draw):
    """Nodes b0..bn in any order, each of which needs only earlier ones."""
    count = draw(st.integers(1, 25))
    needs = [draw(st.sets(st.integers(0, i - 1), max_size=4)) if i else set() for i in range(count)]
    recipes = [Node(f"b{i}", int, {f"b{j}": f"b{j}" for j in need}) for i, need in enumerate(needs)]
    return {recipe.output: recipe for recipe in draw(st.permutations(recipes))}


@given(books(), st.data())
def test_needs_come_first_and_nothing_else_runs(book, data):
    outputs = data.draw(st.lists(st.sampled_from(sorted(book)), min_size=1))
    steps = [step.output for step in topological_order(book, outputs)]
    assert len(set(steps)) == len(steps)
    reached = set(outputs)
    for name in reversed(steps):
        assert name in reached
        assert set(book[name].inputs.values()) <= set(steps[: steps.index(name)])
        reached |= set(book[name].inputs.values())
    assert steps == [step.output for step in topological_order(book, outputs)]


def test_given_buffers_need_no_recipe():
    book = {"a": Node("a", int, {"x": "tile"})}
    assert [step.output for step in topological_order(book, ["a"], ["tile"])] == ["a"]


def test_a_buffer_nobody_makes_is_named():
    with pytest.raises(KeyError, match="tile"):
        topological_order({"a": Node("a", int, {"x": "tile"})}, ["a"])


def test_a_circle_is_shown():
    book = {"a": Node("a", int, {"x": "b"}), "b": Node("b", int, {"x": "a"})}
    with pytest.raises(ValueError, match="a -> b -> a"):
        topological_order(book, ["a"])


def test_needs_are_the_parameters_without_default_or_binding():
    def stage(scene, hits, shadow=None):
        return scene, hits, shadow

    assert required(stage) == ("scene", "hits")
    bound = partial(stage, "a scene")
    assert Node.of(bound, "x").inputs == {"hits": "hits"}
    recipe = Node.of(bound, "x", hits="seen", shadow="shadow:key")
    assert recipe.inputs == {"hits": "seen", "shadow": "shadow:key"}
    assert recipe.run({"seen": 1, "shadow:key": 2}) == ("a scene", 1, 2)
