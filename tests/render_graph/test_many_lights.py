"""Sums over many lights: in their order, and without holding them all."""

from __future__ import annotations

import functools
import operator
from math import isqrt

import numpy as np
import pytest

from illumcli.film.tiles import MIN_SAMPLES_OF_MANY, MIN_TILE_SAMPLES
from illumcli.render_graph.build import build
from illumcli.render_graph.build_lights import BLOCK, DEEPEST, sum_nodes
from illumcli.render_graph.execute import Run, bands, run_once
from illumcli.render_graph.pipeline import plan_view
from illumcli.render_graph.schedule import outputs_of, schedule
from illumcli.scene.load import load
from illumcli.scene.spec import Scene


def scene(count):
    lamps = "".join(
        f"  - {{light: point, position: [{k % 7 - 3}, 4, {k % 5 - 2}], intensity: {1 + k / 7}}}\n"
        for k in range(count)
    )
    return (
        "version: 1\nfilm: {width: 24, height: 16, samples: 1}\nambient: 0.1\n"
        f"objects: [{{mesh: {{shape: torus}}}}]\nlights:\n{lamps}"
    )


@pytest.fixture
def graph(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(scene(3 * BLOCK + 5))
    loaded = load(path)
    return build(loaded.scene, loaded)


def test_the_sum_is_that_of_the_layers_in_their_order(graph):
    outputs, run = outputs_of(graph.scene, ["beauty", "lights", "ambient"]), Run()
    plan = plan_view(graph, outputs, graph.views[0], run.cache)
    (band,) = bands(plan, run_once(plan, run), run)
    parts = [band.layers["ambient"], *(band.layers[name] for name in graph.scene.named_lights())]
    np.testing.assert_array_equal(band.layers["beauty"], functools.reduce(operator.add, parts))


def test_no_more_than_a_block_of_them_is_held(graph):
    plan = schedule(graph, outputs_of(graph.scene, ["beauty"]), graph.views[0])
    last, held, most = plan.last_use(), set(), 0
    for number, step in enumerate(plan.tile):
        held |= {step.output} if step.output.startswith("light:") else set()
        most = max(most, len(held))
        held -= {name for name in held if last.get(name) == number}
    assert not held
    assert most <= BLOCK


def test_a_sum_of_any_length_has_few_blocks():
    lamp = {"light": "directional", "direction": [0, -1, 0]}
    nodes = sum_nodes(Scene(version=1, lights=[lamp] * 3000))
    sums = [node for node in nodes if node.output.startswith("direct")]
    assert len(sums) == DEEPEST
    read = [name for node in sums for name in node.inputs.values() if name.startswith("light:")]
    assert read == [f"light:directional{k}" for k in range(1, 3001)]


def test_tiles_of_many_steps_are_larger(graph, tmp_path):
    (tmp_path / "few.yaml").write_text(scene(1))
    few = load(tmp_path / "few.yaml")
    view = graph.views[0]
    for each, min_samples in ((graph, MIN_SAMPLES_OF_MANY), (build(few.scene, few), MIN_TILE_SAMPLES)):
        plan = schedule(each, outputs_of(each.scene), view)
        assert plan.tile_side(view) == isqrt(min_samples) // 8 * 8
