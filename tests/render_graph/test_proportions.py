"""A warning, once, if a scene is so large beside an object that ray offsets are visible."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.commands.sweep import sweep_scene
from illumcli.scene.variants import variants_of

SCENE = """version: 1
film: {width: 40, height: 30, samples: 1}
camera: {position: [2, 3, 4], target: [0, 0.5, 0]}
objects:
  - {name: ball, mesh: {shape: sphere}, transform: {fit: 1}}
  - {name: floor, mesh: {shape: plane, size: [SIZE, SIZE]}}
lights: [{light: directional, direction: [-1, -1, 0]}]
"""


@pytest.fixture
def told(tmp_path, monkeypatch):
    """The lines about a scene of this text and these overrides."""
    monkeypatch.chdir(tmp_path)

    def lines(text, *overrides, only=()):
        path = tmp_path / "s.yaml"
        path.write_text(text)
        return render_scene(
            RenderJob(path, RenderOptions(overrides, "s.exr", only, force=True, cache=False))
        )[1].warnings

    return lines


def sized(size):
    return SCENE.replace("SIZE", repr(float(size)))


def test_a_floor_that_is_far_too_large_is_told_with_its_place(told):
    (line,) = told(sized(1e5))
    assert "s.yaml:6:5: objects.1: reaches 70,000 times as far as ball is large: around ball" in line
    assert line.endswith(
        "off surfaces, 3.4 % of its radius, and shadows lose contact; make it smaller, or bring it nearer"
    )


@pytest.mark.parametrize("size", [2, 100, 1e4])
def test_a_floor_that_does_no_harm_is_not_told(told, size):
    assert told(sized(size)) == ()


def test_what_is_far_away_is_told_too(told):
    far = sized(2).replace(
        "lights:", "  - {mesh: {shape: sphere}, transform: {translate: [3e5, 0, 0]}}\nlights:"
    )
    (line,) = told(far)
    assert "objects.2: reaches 300,000 times as far as ball is large" in line


def test_terrain_of_small_polygons_is_not_told(told, tmp_path):
    place = np.linspace(-5e4, 5e4, 101)
    vertices = [f"v {x} 0 {z}" for z in place for x in place]
    faces = [
        f"f {k} {k + 101} {k + 102} {k + 1}" for r in range(100) for k in range(101 * r + 1, 101 * r + 101)
    ]
    (tmp_path / "terrain.obj").write_text("\n".join([*vertices, *faces]) + "\n")
    assert told(sized(1e5).replace("{shape: plane, size: [100000.0, 100000.0]}", "terrain.obj")) == ()


def test_pictures_without_secondary_rays_are_not_told(told):
    assert told(sized(1e6), only=["depth"]) == ()
    assert told(sized(1e6), "lights.0.shadows=false") == ()


def test_what_is_small_in_the_picture_is_not_told(told):
    assert told(sized(1e5), "camera.position=[200,300,400]") == ()


def test_a_sweep_says_it_once(told, tmp_path):
    (tmp_path / "s.yaml").write_text(sized(1e6))
    done = sweep_scene(
        tmp_path / "s.yaml", variants_of(["seed=1,2,3"]), RenderOptions(pattern="{seed}.exr", cache=False)
    )
    assert len(done.warnings) == 1
    assert np.isfinite(done.seconds)
