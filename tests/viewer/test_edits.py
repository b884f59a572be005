"""Edits: what the controls of the page set, as overrides of the scene."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from illumcli.errors import InputError
from illumcli.viewer.controls import controls
from viewer.window import Window

SCENE = """version: 1
ambient: [0.3, 0.3, 0.3]
materials:
  clay: {model: phong, diffuse: [0.5, 0.25, 0], specular: 0.4, exponent: 9}
  metal: {model: cook_torrance}
objects: [{mesh: {shape: sphere}, material: clay, name: ball, override: {exponent: 30}}]
lights:
  - {light: point, name: key, position: [1, 2, 3], intensity: 5}
  - {light: point, position: [3, 2, 1]}
"""


@pytest.fixture
def window(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(SCENE)
    return Window(path)


def test_a_value_that_is_the_files_own_is_no_edit(window):
    assert window.set("materials.clay.exponent", 80).materials["clay"].exponent == 80
    assert window.edits == {"materials.clay.exponent": 80}
    window.set("materials.clay.exponent", 9.0)
    window.set("materials.clay.specular", [0.4, 0.4, 0.4])
    assert window.edits == {}


def test_what_is_written_in_short_is_written_out(window):
    assert window.set("ambient.form", "coupled").ambient.form == "coupled"
    assert window.now.scene.ambient.color == (0.3, 0.3, 0.3)
    assert window.set("ambient.color", [0.1, 0, 0]).ambient.form == "coupled"
    window.reset("ambient.form")
    assert window.edits == {"ambient": {"color": [0.1, 0, 0], "form": "separate"}}
    window.reset("ambient.color")
    assert window.edits == {}


def test_a_part_of_a_default_brings_the_default(window):
    alpha = window.set("materials.metal.distribution.m", 0.1).materials["metal"].distribution
    assert (alpha.D, alpha.m) == ("beckmann", 0.1)


def test_another_model_keeps_what_both_have(window):
    clay = window.set("materials.clay.model", "ward").materials["clay"]
    assert (clay.model, clay.diffuse, clay.specular) == ("ward", (0.5, 0.25, 0), (0.4, 0.4, 0.4))
    window.set("materials.clay.alpha_x", 0.3)
    assert list(window.edits) == ["materials.clay", "objects.ball.override.exponent"]
    assert window.edits["materials.clay"]["alpha_x"] == 0.3
    assert window.reset("materials.clay.model") == window.original.scene
    assert window.edits == {}


def test_another_model_keeps_the_colour_of_the_surface_by_any_name(window):
    assert window.set("materials.clay.model", "strauss").materials["clay"].color == (0.5, 0.25, 0)
    assert window.set("materials.clay.model", "principled").materials["clay"].base_color == (0.5, 0.25, 0)


def test_another_light_and_law_get_what_they_need(window):
    assert window.set("lights.key.attenuation.law", "windowed").lights[0].attenuation.range > 0
    sun = window.set("lights.key.light", "directional").lights[0]
    assert (sun.name, sun.irradiance) == ("key", (5, 5, 5))
    assert window.set("lights.1.intensity", 0.5).lights[1].intensity == (0.5, 0.5, 0.5)


def test_parts_come_and_go_by_switches(window):
    assert window.set("depth_cue", True).depth_cue.far > 0
    assert window.set("depth_cue.strength", 0.5).depth_cue.strength == 0.5
    assert window.set("depth_cue", False).depth_cue is None
    assert window.edits == {}
    assert window.set("obscurance", True).obscurance.samples == 64


def test_text_is_yaml(window):
    window.set("film.adaptive", "{probes: 3}")
    assert window.now.scene.film.adaptive.probes == 3
    window.set("materials.clay.diffuse", "#ff0000")
    assert window.now.scene.materials["clay"].diffuse == (1, 0, 0)
    with pytest.raises(InputError, match=r"film\.adaptive: not YAML"):
        window.set("film.adaptive", "{probes: ")


@pytest.mark.parametrize(
    ("path", "value", "fact"),
    [
        ("materials.clay.model", "fong", "no choice 'fong'; did you mean 'phong'"),
        ("materials.clay.model", "merl", "merl needs file, which only its author knows"),
        ("materials.clay.exponent", -1, "must be at least 0"),
        ("materials.none.exponent", 1, "no material 'none'"),
    ],
)
def test_what_cannot_be_is_refused_and_leaves_the_edits(window, path, value, fact):
    with pytest.raises(InputError, match=fact):
        window.set(path, value)
    assert window.edits == {}


def test_all_is_reset_at_once(window):
    window.set("materials.clay.exponent", 80)
    window.set("camera.fov", 50)
    assert window.reset() == window.original.scene


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_random_use_of_the_controls_of_every_scene(root, data):
    window = Window(data.draw(st.sampled_from(sorted((root / "scenes").glob("*.yaml")))))
    for _ in range(6):
        control, value = window.use(data)
        now = {each.path: each for each in controls(window.original, window.now)}
        if control is not None:
            assert now[control.path].value == value
            assert now[control.path].changed == (now[control.path].value != now[control.path].original)
            if data.draw(st.integers(0, 3)) == 0:
                window.reset(control.path)
    assert window.reset() == window.original.scene
