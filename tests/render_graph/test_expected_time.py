"""The time that plans are expected to take."""

from __future__ import annotations

import pytest

from illumcli.cache.recorder import NO_CACHE
from illumcli.cache.speeds import ELAPSED, Speed, SpeedRecorder, Speeds, keep_speeds, read_speeds
from illumcli.cache.store import Store
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.unit import Worker
from illumcli.render_graph.build import build
from illumcli.render_graph.expected_time import time_of, units_of
from illumcli.render_graph.pipeline import plan_view
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.load import load

SCENE = """
version: 1
film: {width: 40, height: 30, samples: 4}
ambient: 1
obscurance: {samples: 8}
objects: [{mesh: {shape: box}, transform: {rotate: [20, 30, 0]}}, {mesh: {shape: disc, radius: 9}}]
lights: [{light: point, name: key, position: [3, 4, 5], intensity: 30}]
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE)
    return tmp_path / "s.yaml"


def units(scene, *overrides):
    loaded = load(scene, overrides)
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene)
    return units_of(plan_view(graph, outputs, graph.views[0], NO_CACHE, look=True))


def test_units_are_rays_samples_and_single_runs(scene):
    found = units(scene)
    assert found["hits"] == found["shadow:key"] == found["points"] == 40 * 30 * 4
    assert found["obscurance"] == 40 * 30 * 4 * 8
    assert found["tracer"] == 1
    assert "shadow:key" not in units(scene, "lights.key.shadows=false")


def test_time_is_that_of_earlier_runs_for_the_same_units():
    recorder = SpeedRecorder()
    recorder.add({"shadow:a": 2.0, "shadow:b": 1.0, "film": 9.0}, {"shadow:a": 100, "shadow:b": 50}, 6.0)
    seconds, of_run = recorder._runs[0]
    speeds = Speeds().then(seconds, of_run)
    assert speeds.stages["shadow"] == Speed(3.0, 150)
    assert speeds.stages[ELAPSED] == Speed(6.0, 3.0)
    expected = time_of({"shadow": 300, "obscurance": 7}, speeds, threads=2)
    assert expected.seconds == pytest.approx(300 * 3 / 150 * 2 / 2)
    assert (expected.runs, expected.unknown) == (1, ("obscurance",))


def test_later_runs_weigh_more():
    speeds = Speeds()
    for _ in range(30):
        speeds = speeds.then({"hits": 1.0}, {"hits": 100})
    for _ in range(10):
        speeds = speeds.then({"hits": 3.0}, {"hits": 100})
    speed = speeds.stages["hits"]
    assert 0.027 < speed.seconds / speed.units < 0.03
    assert speeds.runs == 40


def test_speeds_are_kept_between_runs(tmp_path, scene, monkeypatch):
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "cache"))
    for exposure in (0, 1):
        worker = Worker()
        options = RenderOptions(
            pattern=str(tmp_path / f"{exposure}.png"), overrides=(f"film.exposure={exposure}",)
        )
        worker.run(worker.prepare(RenderJob(scene, options)))
        worker.finish()
    speeds = read_speeds(Store(tmp_path / "cache"))
    assert speeds.runs == 2
    assert speeds.stages["obscurance"].units == pytest.approx(40 * 30 * 4 * 8)  # the second run loaded it
    assert speeds.stages["beauty"].seconds > 0


def test_entries_of_something_else_are_no_speeds(tmp_path):
    store = Store(tmp_path)
    keep_speeds(store, Speeds({"hits": Speed(1, 2)}, 3))
    assert read_speeds(store) == Speeds({"hits": Speed(1, 2)}, 3)
    (entry,) = store.entries()
    store.save(entry.key, {"buffer": "speeds", "stages": {"hits": [1]}}, [])
    assert read_speeds(store) == Speeds()
    entry.path.write_bytes(b"damaged")
    assert read_speeds(store) == Speeds()
