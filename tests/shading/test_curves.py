"""Curves over the surface: each point has the value that the curve has at its own moment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import illumcli
from illumcli.errors import InputError
from illumcli.images.writer import ImageWriter
from illumcli.models._parameters import CurveOverSurface
from illumcli.scene.curves import CURVES
from illumcli.scene.frames import Moment
from illumcli.schema.families import member
from illumcli.shading.curves import curve_at

KEYS = {"0": [0.2, 0.9, 0.1], "3": 0.5, "4": [0.1, 0.8, 0.6], "10": 0}
KINDS = {
    "linear": {"keys": KEYS},
    "smooth": {"keys": KEYS},
    "step": {"keys": KEYS},
    "formula": {"value": ["0.5 + 0.5*sin(frame)", "exp(-abs(time))", 0.25]},
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_curve_at_every_point_is_the_curve_at_its_moment(kind):
    made = member(CURVES, kind).model_validate({"curve": kind, **KINDS[kind]})
    moment = Moment(6, 0.25)
    delay = np.random.default_rng(1).uniform(-9, 9, 200).astype(np.float32)
    over = CurveOverSurface.model_validate({"moment": 6, "phi": made.phi(moment, open)})
    found = curve_at(over, {"delay": delay[:, None]}, 3)
    for row, late in zip(found, delay.tolist(), strict=True):
        at = 6 - late
        expected = np.broadcast_to(made.phi_at(Moment(at, at / 24), open), 3)
        np.testing.assert_allclose(row, expected, rtol=1e-11, atol=1e-12)  # those have 12 digits


def test_all_four_maps():
    phi = {"positions": [0, 10], "values": [[0], [1]]}
    over = CurveOverSurface.model_validate({"moment": 4, "phi": phi})
    maps = {
        "rate": np.array([[0.5], [2.0]]),
        "delay": np.array([[1.0], [-1.0]]),
        "scale": np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        "offset": np.array([[0.0, 0.1, 0.2], [0.3, 0.4, 0.5]]),
    }
    t = np.array([[0.1], [0.9]])  # (0.5 * 4 - 1) / 10 and (2 * 4 + 1) / 10
    np.testing.assert_allclose(curve_at(over, maps, 3), maps["scale"] * t + maps["offset"], rtol=1e-15)


# -- in pictures


def picture(path: Path, values: np.ndarray) -> None:
    pixels = np.round(255 * np.repeat(values[:, :, None], 3, axis=2)).astype(np.uint8)
    with ImageWriter(path, *values.shape[::-1], dict.fromkeys("RGB", "uint8"), {}) as writer:
        writer.write_band(0, np.ascontiguousarray(pixels))


@pytest.fixture
def rendered(tmp_path):
    """Renders a ball, three of whose parameters are curves with the same maps, at a frame."""
    picture(tmp_path / "black.png", np.zeros((4, 4)))
    picture(tmp_path / "white.png", np.ones((4, 4)))
    picture(tmp_path / "halves.png", np.repeat([[0.0], [0.0], [1.0], [1.0]], 4, axis=1))

    def beauty(maps="", frame=0, exponent="{curve: linear, keys: {0: 100, 12: 7}MAPS}"):
        path = tmp_path / "s.yaml"
        path.write_text(f"""version: 1
frames: {{last: 30}}
camera: {{position: [0.6, 1, 4], target: [0, 0, 0]}}
film: {{width: 40, height: 40, samples: 1}}
materials:
  m:
    model: phong
    diffuse: {{curve: smooth, keys: {{0: "#8c2917", 5: 0.7, 12: "#2f5fa8"}}{maps}}}
    specular: {{curve: formula, value: 0.3*exp(-time){maps}}}
    exponent: {exponent.replace("MAPS", maps)}
objects: [{{mesh: {{shape: sphere}}, material: m}}]
lights: [{{light: directional, direction: [-1, -1, -0.6], irradiance: 3}}]
""")
        (found,) = illumcli.render(path, frames=[frame])
        return found

    return beauty


@pytest.mark.parametrize("frame", [0, 3, 7, 12, 20])
def test_a_map_of_zeros_is_the_curve_bit_for_bit(rendered, frame):
    one = rendered(", delay: {texture: black.png}", frame)["beauty"]
    np.testing.assert_array_equal(one, rendered("", frame)["beauty"])


@pytest.mark.parametrize(
    ("maps", "at"),
    [
        (", delay: {texture: white.png, factor: 5}", 7),
        (", rate: {texture: white.png, factor: 0.5}", 6),
        (", rate: {texture: white.png, factor: 2}, delay: {texture: white.png, factor: 20}", 4),
    ],
)
def test_constant_maps_are_the_curve_at_another_frame(rendered, maps, at):
    np.testing.assert_array_equal(rendered(maps, 12)["beauty"], rendered("", at)["beauty"])


def test_each_half_has_its_own_moment(rendered):
    mixed = rendered(", delay: {texture: halves.png, filter: nearest, factor: 8}", 10)["beauty"]
    early, late = rendered("", 10)["beauty"], rendered("", 2)["beauty"]
    is_early, is_late = (np.all(mixed == each, axis=2) for each in (early, late))
    assert np.all(is_early | is_late)
    assert np.count_nonzero(is_early & ~is_late) > 150
    assert np.count_nonzero(is_late & ~is_early) > 150


def test_a_later_frame_traces_no_ray(rendered, tmp_path):
    rendered(", delay: {texture: halves.png, factor: 8}", 3)
    found = illumcli.render(tmp_path / "s.yaml", frames=[3, 5])
    assert [each.report["rays"] for each in found][1] == {}


def test_values_out_of_range_are_clipped_and_counted(rendered):
    found = rendered(", delay: {texture: halves.png}, offset: [-0.001, 1, 2], scale: 0", 3)
    assert found.report["repairs"] == {
        "values beyond material m: diffuse clipped to 0..1e+18": 16,
        "values beyond material m: specular clipped to 0..1e+18": 16,
        "values beyond material m: exponent clipped to 0..1e+18": 16,
    }


def test_a_formula_that_is_not_finite_is_refused(rendered):
    late = "{curve: formula, value: log(frame), delay: {texture: halves.png, factor: 8}}"
    with pytest.raises(InputError, match="material m: exponent: its formula is not finite at some points"):
        rendered(frame=3, exponent=late)
