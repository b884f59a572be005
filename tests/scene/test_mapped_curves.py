"""Curves that are shifted and scaled: by numbers anywhere, by maps for parameters of materials."""

from __future__ import annotations

import pytest

from illumcli.errors import InputError
from illumcli.models._parameters import CurveOverSurface, Texture
from illumcli.scene.access import file_problems
from illumcli.scene.animation import overrides_of_frame
from illumcli.scene.curves import CURVES
from illumcli.scene.frames import Moment
from illumcli.scene.load import load
from illumcli.schema.families import member

TABLE = "frame,a,b\n0,1,4\n7,3,-1\n20,2,2\n"
KEYS = {"0": 1, "7": [3, 1, 0], "20": 2}
KINDS = {
    "linear": {"keys": KEYS},
    "smooth": {"keys": KEYS},
    "step": {"keys": KEYS},
    "formula": {"value": ["sin(frame)", "time**2", 3]},
    "column": {"file": "t.csv", "column": ["a", "b", "b"], "interpolation": "smooth"},
}
SCENE = """version: 1
frames: {last: 12}
materials:
  m: {model: phong, exponent: EXPONENT}
objects:
  - {mesh: {shape: sphere}, material: m}
lights:
  - {light: directional, direction: [0, -1, 0]}
"""
MAP = "delay: {texture: map.png}"


def value(kind, frame, fps=24.0, **fields):
    made = member(CURVES, kind).model_validate({"curve": kind, **KINDS[kind], **fields})
    return made.value_at(Moment(frame, frame / fps, fps), lambda path: (path, TABLE))


@pytest.fixture
def scene(tmp_path):
    """Loads the scene with a curve as exponent, at a frame."""

    def loaded(exponent, frame=None, overrides=()):
        path = tmp_path / "s.yaml"
        path.write_text(SCENE.replace("EXPONENT", exponent))
        (tmp_path / "map.png").touch()
        return load(path, overrides, frame=frame)

    return loaded


@pytest.mark.parametrize("kind", KINDS)
def test_a_delay_is_the_curve_later_and_a_rate_the_curve_faster(kind):
    for frame in (0, 5, 9, 14, 30):
        assert value(kind, frame + 4, delay=4) == value(kind, frame)
        assert value(kind, frame, rate=2) == value(kind, 2 * frame)
        assert value(kind, 10 + frame, rate=2, delay=20) == value(kind, 2 * frame)


@pytest.mark.parametrize("kind", KINDS)
def test_scale_and_offset_are_for_all_components_or_each(kind):
    plain = value(kind, 5)
    plain = plain if isinstance(plain, list) else [plain] * 3
    found = value(kind, 5, scale=-2, offset=[1, 0.5, 0])
    if isinstance(found, list):
        assert found == pytest.approx([1 - 2 * plain[0], 0.5 - 2 * plain[1], -2 * plain[2]], rel=1e-11)
    else:  # a key that is one number
        assert found == pytest.approx(1 - 2 * plain[0])


def test_a_delay_over_time_is_in_seconds():
    made = member(CURVES, "formula").model_validate(
        {"curve": "formula", "value": "time + frame", "over": "time", "delay": 0.5}
    )
    assert made.value_at(Moment(12, 1.0, 12.0), lambda path: (path, "")) == 0.5 + 6


def test_two_factors_for_two_numbers_are_refused():
    with pytest.raises(ValueError, match="has 2 numbers; scale and offset must be one number"):
        member(CURVES, "linear").model_validate(
            {"curve": "linear", "keys": {"0": [1, 2]}, "scale": [1, 2, 3]}
        ).value_at(Moment(0, 0.0), lambda path: (path, ""))


def test_a_map_makes_a_parameter_that_varies(scene):
    loaded = scene("{curve: smooth, keys: {0: 5, 9: 50}, rate: 2, " + MAP + "}", frame=3)
    curve = loaded.scene.materials["m"].exponent
    assert isinstance(curve, CurveOverSurface)
    assert (curve.moment, curve.rate, curve.delay) == (3, 2, Texture(texture="map.png"))
    assert (curve.phi.positions, curve.phi.values, curve.phi.interpolation) == (
        (0, 9),
        ((5,), (50,)),
        "smooth",
    )
    assert list(loaded.scene.materials["m"].varying()) == ["exponent"]


@pytest.mark.parametrize(
    "exponent",
    ["{curve: step, keys: {0: 5, 9: 50}, " + MAP + "}", "{curve: formula, value: 9 + time, " + MAP + "}"],
)
def test_the_value_of_a_frame_as_an_override_is_the_same_scene(scene, exponent):
    there = scene(exponent, frame=7)
    (given,) = overrides_of_frame(there)
    again = scene("7", overrides=[given])
    assert again.scene.materials["m"] == there.scene.materials["m"]


@pytest.mark.parametrize(
    ("exponent", "place", "fact"),
    [
        ("{curve: linear, keys: {0: 1}, delay: {texture: map.pn}}", "4:69", "no file"),
        ("{curve: linear, keys: {0: 1}, delay: {texture: map.png, wrap: no}}", "4:87", "wrap"),
        ("{curve: linear, keys: {0: [1, 2, 3]}, " + MAP + "}", "4:31", "must be one number, its curve has 3"),
        ("{curve: linear, keys: {0: [1, 2]}, " + MAP + "}", "4:21", "must have numbers or colours as keys"),
        ("{curve: step, keys: {0: text}, " + MAP + "}", "4:21", "must have numbers or colours as keys"),
        ("{curve: formula, value: [1, 2], " + MAP + "}", "4:21", "must be one or three formulas"),
    ],
)
def test_faults_name_their_place(scene, exponent, place, fact):
    with pytest.raises(InputError) as refusal:
        raise InputError(file_problems(scene(exponent)))
    (problem,) = refusal.value.problems
    assert f"s.yaml:{place}: materials.m.exponent" in problem
    assert fact in problem


def test_maps_of_what_is_no_parameter_are_refused(scene):
    turned = "camera.position={curve: linear, keys: {0: [0, 0, 5], 9: [0, 5, 5]}, " + MAP + "}"
    with pytest.raises(InputError, match="at frame 0: maps vary it over the surface, and only parameters of"):
        scene("7", overrides=[turned])
