"""A layer at several samplings: what is shared between them does not depend on any."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from illumcli.accuracy.sampled import OF_SAMPLING, Sampling, sampled_layer
from illumcli.render_graph.execute import Run
from illumcli.render_graph.keys import Keys
from illumcli.render_graph.tile_nodes import RenderStats
from illumcli.scene.load import load
from planned import layers_of, planned
from ring import RING

SAMPLING = Sampling(2, 4, "spiral", 1)
OTHERS = [
    replace(SAMPLING, pixel=3),
    replace(SAMPLING, obscurance=9),
    replace(SAMPLING, sampler="owen"),
    replace(SAMPLING, seed=2),
]


@pytest.fixture
def layer(tmp_path):
    path = tmp_path / "ring.yaml"
    path.write_text(RING.format(samples=1, ambient=1))
    return sampled_layer(load(path), "beauty", threads=1)


def keys_once(layer, sampling):
    """The key of every buffer of the whole scene at a sampling."""
    plan = layer.planned(sampling)
    keys = Keys(plan.graph.nodes, None, "")
    return {node.output: keys(node.output) for node in plan.once}


def test_the_listed_buffers_are_those_that_depend_on_the_sampling(layer):
    first = keys_once(layer, SAMPLING)
    differing = set()
    for other in OTHERS:
        second = keys_once(layer, other)
        assert second.keys() == first.keys()
        differing |= {name for name in first if first[name] != second[name]}
    assert differing == set(OF_SAMPLING)


@pytest.mark.parametrize("other", OTHERS, ids=["pixel", "obscurance", "sampler", "seed"])
def test_an_image_does_not_depend_on_those_before(layer, other):
    expected, rays, _ = replace(layer, shared={}).render(other)
    layer.render(SAMPLING)
    after, same_rays, _ = layer.render(other)
    assert np.array_equal(after, expected)
    assert same_rays == rays
    assert not np.array_equal(after, layer.render(SAMPLING)[0])


@pytest.mark.parametrize("adaptive", ["null", "false"])
def test_a_reconstructed_image_is_that_of_a_render(tmp_path, adaptive):
    """Adaptive as the scene is, whatever its cameras' own samples."""
    path = tmp_path / "ring.yaml"
    path.write_text(RING.format(samples=1, ambient=1))
    own = f"film.adaptive={adaptive}"
    layer = sampled_layer(load(path, [own, "camera.samples=1"]), "beauty", threads=1)
    values, rays, _ = layer.render(Sampling(4, 2, "spiral", 3, reconstruct=True))
    counts = ("camera.samples=4", "obscurance.samples=2", "obscurance.reconstruct=true", "seed=3")
    stats = RenderStats()
    steps = planned(load(path, [own, *counts]), ["beauty"])
    assert values.tobytes() == layers_of(steps, Run(stats))["beauty"].tobytes()
    assert rays == sum(stats.rays.values())
    assert (stats.refined > 0) == (adaptive == "null")
