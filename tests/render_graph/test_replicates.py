"""The layer `error` is the picture's true standard error, costs what the plan says, and changes nothing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.plan_table import plan_table
from illumcli.commands.render import render_scene
from illumcli.render_graph.execute import RenderStats, Run
from illumcli.render_graph.explain import expected_rays, plan_data
from illumcli.render_graph.replicates import LUMINANCE
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 96, height: 64, samples: 1}
ambient: 1
obscurance: {samples: 16}
objects:
  - {mesh: {shape: disc, radius: 5}, material: {model: lambert, diffuse: 0.9}}
  - {mesh: {shape: torus}, material: {model: lambert, diffuse: 0.9}}
"""
LAMP = "lights=[{light: point, position: [3, 4, 2], intensity: 30}]"


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def layers(path, *overrides, only=("beauty", "error")):
    """Layer -> (H, W, channels), and the rays by step."""
    loaded = load(path, overrides)
    steps, tally = planned(loaded, only), RenderStats()
    return layers_of(steps, Run(tally, threads=2)), tally.rays


def shown(path, *overrides):
    """(H, W) luminance of the beauty over its background."""
    scene = load(path, overrides).scene
    made, _ = layers(path, *overrides, only=("beauty",))
    picture = made["beauty"] + (1 - made["alpha"]) * np.asarray(scene.film.background or (0, 0, 0))
    return picture.astype(float) @ LUMINANCE


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("film.samples=4", "obscurance.samples=5"),
        ("obscurance.sampler=random",),
        ("film.samples=8", "obscurance=null", LAMP),
        ("film.samples=4", "obscurance=null", "film.background=4"),
    ],
    ids=["rays", "rays and edges", "independent rays", "shadows and edges", "edges of the background"],
)
def test_stated_is_half_the_squared_difference_of_two_pictures(scene, overrides):
    others = np.array([shown(scene, *overrides, f"seed={seed}") for seed in range(1, 11)])
    true = np.mean(np.square(others[0::2] - others[1::2]) / 2, axis=0)
    # four layers: where only edges err, a small picture has few pixels that tell
    made = [layers(scene, *overrides, f"seed={seed}")[0]["error"] for seed in range(20, 24)]
    stated = np.square(np.array(made, float))
    assert np.sqrt(stated.mean() / true.mean()) == pytest.approx(1, abs=0.15)


def test_200_pixels_anywhere_suffice_to_see_it(scene):
    others = np.array([shown(scene, f"seed={seed}") for seed in range(1, 11)])
    true = np.mean(np.square(others[0::2] - others[1::2]) / 2, axis=0)
    stated = np.square(layers(scene)[0]["error"][..., 0].astype(float))
    for number in range(10):
        some = np.random.default_rng(number).choice(true.size, 200, replace=False)
        assert np.sqrt(stated.ravel()[some].mean() / true.ravel()[some].mean()) == pytest.approx(1, abs=0.15)


def test_a_block_has_one_error_and_empty_sky_has_none(scene):
    made, _ = layers(scene, "camera.target=[0,1.6,0]")
    error, alpha = made["error"][..., 0], made["alpha"][..., 0]
    blocks = error.reshape(8, 8, 12, 8).transpose(0, 2, 1, 3).reshape(8, 12, 64)
    assert (blocks == blocks[..., :1]).all()
    empty = alpha.reshape(8, 8, 12, 8).max(axis=(1, 3)) == 0
    assert empty.any()
    assert not blocks[empty].any()


@pytest.mark.parametrize(("width", "height"), [(1, 1), (9, 3), (17, 10)])
def test_films_that_cut_blocks_and_cells(scene, width, height):
    made, _ = layers(scene, f"film={{width: {width}, height: {height}, samples: 4}}", "camera.fov=10")
    assert made["error"].shape == (height, width, 1)
    assert np.isfinite(made["error"]).all()
    assert made["error"].any()


def test_the_picture_is_the_same_and_a_quarter_of_it_is_replicated(scene):
    overrides = ("film.width=95", "film.samples=4", LAMP)
    alone, rays = layers(scene, *overrides, only=("beauty",))
    made, more = layers(scene, *overrides)
    for name, values in alone.items():
        assert values.tobytes() == made[name].tobytes()
    assert {name: count for name, count in more.items() if not name.startswith("replicate.")} == rays
    assert more["replicate.hits"] == pytest.approx(rays["hits"] / 4, rel=0.05)
    assert more["replicate.obscurance"] == pytest.approx(rays["obscurance"] / 4, rel=0.05)
    loaded = load(scene, overrides)
    plan = planned(loaded, ("beauty", "error"))
    expected = expected_rays(loaded.scene, [plan.view], plan.computed)
    assert expected["replicate.primary"] == 48 * 32 * 4
    assert expected["replicate.obscurance"] == 48 * 32 * 4 * 16


def test_nothing_random_is_exact_and_doubles_nothing(scene):
    made, rays = layers(scene, "obscurance=null", LAMP)
    assert not made["error"].any()
    assert not [name for name in rays if name.startswith("replicate.")]
    loaded = load(scene, ("obscurance=null",))
    time = {"seconds": 0.0, "runs": 0, "unknown": []}
    rest = {"expected_time": time, "obscurance_files": {}, "whole": None}
    part = plan_data(planned(loaded, ("error",)), {}) | rest
    assert "nothing in the image is random: its error is 0" in plan_table([part])


def test_the_report_and_the_file_have_it(scene, tmp_path):
    from illumcli.images.reader import read_image

    target = tmp_path / "out.exr"
    _, report = render_scene(
        RenderJob(scene, RenderOptions(pattern=str(target), only=("beauty", "error"), cache=False))
    )
    image = read_image(target)
    error = image.channels["error.Y"].astype(float)
    said = json.loads(json.dumps(report.as_data()))["standard_error"]["main"]
    assert said["mean"] == pytest.approx(error.mean())
    assert said["rms"] == pytest.approx(np.sqrt(np.square(error).mean()))
