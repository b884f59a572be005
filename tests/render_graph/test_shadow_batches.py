"""Shadows of several lights at once: the bits and rays of one light after the other."""

from __future__ import annotations

import pytest

from illumcli.render_graph import shadow_batches
from illumcli.render_graph.build import GIVEN, build
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.render_graph.schedule import outputs_of, schedule
from illumcli.render_graph.shadow_batches import batched
from illumcli.scene.load import load

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 60, height: 40, samples: 1}
objects:
  - {mesh: {shape: plane, size: [6, 6]}}
  - {mesh: {shape: sphere, radius: 0.5, segments: 9, rings: 6}, transform: {translate: [0, 0.5, 0]}}
  - {mesh: {shape: torus, segments: 12, sides: 6}, transform: {scale: 0.3, translate: [0.7, 0.6, 0.6]}}
lights:
  - {light: directional, name: sun, direction: [1, -0.4, -1]}
  - {light: point, name: fill, position: [0, 3, 3], shadows: false}
"""


TOGETHER = ["shadows until shadow:l6", "shadows until shadow:l8"]


@pytest.fixture
def loaded(tmp_path):
    rings = [
        f"  - {{light: point, name: l{k}, position: [{k - 4}, {0.3 + k % 3}, {4 - k % 5}], intensity: 9}}\n"
        for k in range(9)
    ]
    (tmp_path / "scene.yaml").write_text(SCENE + "".join(rings))
    return load(tmp_path / "scene.yaml")


def plan_of(loaded):
    graph = build(loaded.scene, loaded)
    return schedule(graph, outputs_of(loaded.scene, ["beauty", "shadows"]), graph.views[0])


def rendered(loaded):
    """The bytes of each layer, and the rays of each light."""
    plan, run = plan_of(loaded), Run(RenderStats())
    layers: dict[str, bytes] = {}
    for band in bands(plan, run_once(plan, run), run):
        for name, values in band.layers.items():
            layers[name] = layers.get(name, b"") + values.tobytes()
    return layers, {name: rays for name, rays in run.stats.rays.items() if name.startswith("shadow:")}, run


@pytest.mark.parametrize("size", [2, 3, 8])
def test_a_batch_has_the_bits_and_rays_of_its_lights(loaded, monkeypatch, size):
    monkeypatch.setattr(shadow_batches, "BATCH", 1)
    layers, rays, _ = rendered(loaded)
    assert sum(rays.values()) > sum(len(values) for values in layers.values()) / 1000
    monkeypatch.setattr(shadow_batches, "BATCH", size)
    batch_layers, batch_rays, run = rendered(loaded)
    assert batch_layers == layers
    assert batch_rays.keys() == rays.keys()
    assert sum(batch_rays.values()) == sum(rays.values())
    assert rays.keys() <= run.stats.seconds.keys()


def test_every_node_comes_after_its_inputs_and_the_incident_light_of_a_batch_is_held(loaded):
    plan = plan_of(loaded)
    nodes = batched(plan.tile)
    done = {*GIVEN, *(node.output for node in plan.once)}
    for node in nodes:
        assert done >= set(node.inputs.values())
        done.add(node.output)
    names = [node.output for node in nodes]
    assert [name for name in names if name.startswith("shadows until")] == TOGETHER
    assert sorted(set(names) - {*TOGETHER}) == sorted(n.output for n in plan.tile)


def test_few_lights_flat_objects_and_adaptive_pictures_have_none(tmp_path):
    for change in ("seed=1", "shading=constant", "film.samples=8"):
        (tmp_path / "scene.yaml").write_text(SCENE)
        plan = plan_of(load(tmp_path / "scene.yaml", [change]))
        batches = shadow_batches.with_shadow_batches(plan)
        assert not [node for node in batches.tile if node.output.startswith("shadows until")]
