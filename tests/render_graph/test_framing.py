"""Cameras that are placed so that an object fills the picture."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.accuracy.sampled import sampled_layer
from illumcli.cache.location import default_folder
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.plan import ScenePlan
from illumcli.commands.render import render_scene
from illumcli.commands.sweep import sweep_scene
from illumcli.errors import InputError
from illumcli.images.reader import read_image
from illumcli.rays.camera import MARGIN
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import Run
from illumcli.render_graph.framing import place_cameras
from illumcli.scene.load import load
from illumcli.scene.variants import variants_of

SCENE = """
version: 1
film: {width: 60, height: 40, samples: 1}
camera: {position: [0.4, 0.3, 0.9], target: [0, 0, 0], fit: rod, fov: 30}
meshes: {rod: {shape: box, size: [0.2, 3, 0.2]}}
objects:
  - {name: rod, mesh: rod, transform: {translate: [7, 0, -2]}}
  - {name: floor, mesh: {shape: disc, radius: 30}, transform: {translate: [0, -1.6, 0]}}
  - {name: far, mesh: {shape: sphere}, transform: {translate: [-900, 0, 0]}}
ambient: 0.5
outputs: {files: ["{scene}.{camera}.exr"], layers: [object_id]}
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "s.yaml"
    path.write_text(SCENE)
    return path


def rows_and_columns(path, number=1):
    """First and last row, then column, of an object's pixels."""
    ids = read_image(path).channels["objectId.Y"]
    found = np.nonzero(ids == number)
    return [(int(each.min()), int(each.max())) for each in found]


@pytest.mark.parametrize("more", [[], ["camera.fov=70"], ["camera={projection: orthographic, fit: rod}"]])
def test_all_of_the_object_is_in_the_picture_and_fills_it(scene, more):
    (path,), _ = render_scene(RenderJob(scene, RenderOptions(more, cache=False)))
    rows, columns = rows_and_columns(path)
    assert rows[0] in (1, 2, 3)
    assert rows[1] in (36, 37, 38)
    assert rows[0] + rows[1] == pytest.approx(39, abs=2)
    assert columns[0] + columns[1] == pytest.approx(59, abs=2)
    assert rows[1] - rows[0] + 1 == pytest.approx(40 * (1 - MARGIN), abs=1.5)


def test_several_cameras_are_each_placed(scene):
    scene.write_text(
        SCENE.replace("camera: {", "cameras: {wide: {width: 80, height: 20, ").replace(
            "fov: 30}", "fov: 30}, plain: {position: [7, 0, 9], target: [7, 0, 0]}}"
        )
    )
    wide, plain = render_scene(RenderJob(scene, RenderOptions(cache=False)))[0]
    assert rows_and_columns(wide)[0][0] in (0, 1)
    assert read_image(plain).width == 60


def test_an_object_that_nobody_sees_is_left_out_of_the_placed_view(scene):
    _, report = render_scene(RenderJob(scene, RenderOptions(["ambient=0"], cache=False)))
    assert report.skipped["object:far"]


def test_the_plan_knows_where_the_camera_stands_once_it_was_there(scene):
    words = ["film.width=600", "film.height=400", "film.samples=4"]
    cold = ScenePlan(scene, variants_of(words)).parts()
    assert "hits" not in cold[0]["reused"]
    render_scene(RenderJob(scene, RenderOptions(words)))
    warm = ScenePlan(scene, variants_of(words)).parts()
    assert "hits" in warm[0]["reused"]
    assert "camera:main" not in warm[0]["skipped"]
    loaded = load(scene, words)
    graph = build(loaded.scene, loaded)
    run_ = Run(cache=Cache(Store(default_folder(), 1 << 30)))
    assert placed_camera(graph, run_, only_cached=True) == placed_camera(graph, Run())


def test_a_sweep_places_its_cameras(scene, tmp_path):
    variants = variants_of(["camera.fov=10,50"])
    done = sweep_scene(scene, variants, RenderOptions(pattern="{camera.fov}.exr", cache=False))
    assert [outcome.error for outcome in done.outcomes] == [None, None]
    for name in ("10", "50"):
        rows, _ = rows_and_columns(tmp_path / f"{name}.exr")
        assert rows[1] - rows[0] + 1 == pytest.approx(40 * (1 - MARGIN), abs=1.5)


def test_a_view_that_is_measured_is_placed_too(scene):
    loaded = load(scene)
    own = sampled_layer(loaded, "beauty")
    assert own.view.camera == placed_camera(build(loaded.scene, loaded), Run())


def test_fit_names_an_object(scene):
    with pytest.raises(InputError, match=r"s.yaml:4:56: camera.fit: no object 'rodd'; did you mean 'rod'\?"):
        load_with(scene, "fit: rod,", "fit: rodd,")


def placed_camera(graph, run_, only_cached=False):
    return place_cameras(graph, run_, only_cached).views[0].camera


def load_with(path, old, new):
    path.write_text(path.read_text().replace(old, new))
    return load(path)
