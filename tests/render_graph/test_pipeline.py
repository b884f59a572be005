"""The steps from a scene to a plan, each a function from value to value."""

from __future__ import annotations

from functools import partial

import pytest

from illumcli.cache import policy
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.commands import work
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.graph import topological_order
from illumcli.render_graph import build as module
from illumcli.render_graph.build import build
from illumcli.render_graph.cached import substitute_cached
from illumcli.render_graph.culling import cull, find_bounds
from illumcli.render_graph.execute import Run, run_once
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.schedule import needed_buffers, outputs_of, schedule
from illumcli.scene.load import load

SCENE = """
version: 1
film: {width: 8, height: 6, samples: 1}
ambient: 0.2
objects:
  - {name: ball, mesh: {shape: sphere}}
  - {name: away, mesh: {shape: box}, transform: {translate: [90, 0, 0]}}
cameras:
  front: {position: [0, 0, 5]}
  back: {position: [0, 1, -5]}
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    return tmp_path / "s.yaml"


def counted(counts, name, function, *words, **named):
    counts[name] = counts.get(name, 0) + 1
    return function(*words, **named)


def test_a_scene_of_two_cameras_is_built_once_and_ordered_a_few_times(path, monkeypatch, tmp_path):
    counts = {}
    monkeypatch.setattr(work, "build", partial(counted, counts, "build", build))
    monkeypatch.setattr(module, "topological_order", partial(counted, counts, "order", topological_order))
    paths, _ = render_scene(RenderJob(path, RenderOptions(pattern=str(tmp_path / "{camera}.png"))))
    assert len(paths) == 2
    assert counts["build"] == 1
    assert counts["order"] <= 14  # each is about a tenth of a millisecond


def test_no_part_changes_what_it_is_given(path, tmp_path, monkeypatch):
    monkeypatch.setattr(policy, "worth", lambda seconds, size: True)
    loaded = load(path)
    outputs = outputs_of(loaded.scene)
    built, run = build(loaded.scene, loaded), Run(cache=Cache(Store(tmp_path / "kept")))
    nodes = dict(built.nodes)

    known, bounds = find_bounds(built, outputs, run)
    assert built.known == {}
    assert known.nodes is built.nodes
    culled = cull(known, outputs, bounds)
    assert (known.culled, culled.culled) == ((), (1,))
    assert dict(built.nodes) == nodes
    assert "every_mesh" not in known.nodes

    view = culled.views[0]
    cached, lookup = substitute_cached(culled, needed_buffers(culled, outputs, [view]), view, run.cache)
    assert culled.loaders == {}
    assert cached.nodes is culled.nodes
    plan = schedule(cached, outputs, view, lookup)
    run_once(plan, run)
    assert plan == plan_view(culled, outputs, view, run.cache) or lookup.keeps  # its buffers are kept by now
    again = plan_view(culled, outputs, view, run.cache)
    assert "geometry" in again.lookup.reused
    assert "geometry" in plan.lookup.keeps


def test_a_culled_scene_knows_every_mesh_by_the_key_it_had(path):
    """What is known of all objects is not computed again for those that are left."""
    loaded = load(path)
    outputs = outputs_of(loaded.scene)
    run = Run()
    graph = place_and_cull(build(loaded.scene, loaded), outputs, run)
    plan = plan_view(graph, outputs, graph.views[0], run.cache)
    shared = run_once(plan, run)
    assert shared["every_mesh"] is graph.known["every_mesh"].value
    assert [mesh.polygon_count > 0 for mesh in shared["meshes"]] == [True, False]
