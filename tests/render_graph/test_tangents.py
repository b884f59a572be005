"""Grain in pictures: highlights lie across the grain, whatever the object's transform and side."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {{projection: orthographic, position: [0, 10, 0], target: [0, 0, 0], up: [0, 0, -1], extent: 2}}
film: {{width: 48, height: 48, samples: 1}}
materials:
  brushed: {{model: ward, diffuse: 0, specular: 0.3, alpha_x: 0.05, alpha_y: 0.4}}
objects:
  - {{mesh: {mesh}, material: brushed, {more}}}
lights:
  - {{light: point, position: [0, 1, 0], intensity: 1, shadows: false}}
"""


@pytest.fixture
def highlight(tmp_path):
    def render(more, mesh="{shape: plane, size: [8, 8]}"):
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE.format(more=more, mesh=mesh))
        return layers_of(planned(load(path)))["beauty"][..., 0]

    return render


def spreads(picture):
    """Standard deviations of the light along the picture's x and y, and their correlation [pixels]."""
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] - (np.array(picture.shape) - 1)[:, None, None] / 2
    weight = picture / picture.sum()
    xx, yy, xy = (weight * x * x).sum(), (weight * y * y).sum(), (weight * x * y).sum()
    return np.sqrt(xx), np.sqrt(yy), xy / np.sqrt(xx * yy)


def test_a_highlight_is_stretched_across_the_grain(highlight):
    along, across, _ = spreads(highlight("grain: [1, 0, 0]"))
    assert across > 2.5 * along
    across, along, _ = spreads(highlight("grain: [0, 0, 1]"))
    assert across > 2.5 * along


def test_by_default_the_grain_is_where_u_grows(highlight):
    np.testing.assert_allclose(highlight("name: plain"), highlight("grain: [1, 0, 0]"), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("grain", ["name: plain", "grain: [1, 0, 0]"])
def test_the_grain_turns_with_its_object(highlight, grain):
    picture = highlight(f"{grain}, transform: {{rotate: [0, 90, 0]}}")
    np.testing.assert_allclose(picture, highlight("grain: [0, 0, 1]"), rtol=1e-4, atol=1e-6)
    x, z, slant = spreads(highlight(f"{grain}, transform: {{rotate: [0, 45, 0]}}"))
    assert x == pytest.approx(z, rel=1e-3)
    assert slant > 0.5  # the grain runs from lower left to upper right... the light across it


def test_a_slanted_grain_follows_an_uneven_scale(highlight):
    stretched = highlight("grain: [1, 0, -1], transform: {scale: [3, 1, 1]}")
    np.testing.assert_allclose(stretched, highlight("grain: [3, 0, -1]"), rtol=1e-4, atol=1e-6)


def test_the_back_of_a_sheet_shines_as_its_front_does(highlight):
    for grain in ("name: plain", "grain: [1, 0, 0]"):
        front = highlight(grain)
        back = highlight(f"{grain}, transform: {{rotate: [180, 0, 0]}}")
        np.testing.assert_allclose(back, front, rtol=1e-4, atol=1e-6)


DISC = "{shape: disc, segments: 180}"


def test_rings_about_the_axis_give_a_highlight_of_one_shape_all_round(highlight):
    picture = highlight("grain: {axis: [0, 1, 0]}", DISC)
    np.testing.assert_allclose(picture, picture.T, rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(picture, picture[::-1], rtol=1e-3, atol=1e-5)
    along_radius = picture[24, 24:]  # on every radius the grain lies across: the wide slope counts
    assert along_radius[12] > 20 * highlight("grain: [1, 0, 0]", DISC)[24, 36]


def test_rings_keep_to_their_own_centre_under_a_transform(highlight):
    here = highlight("grain: {centre: [0.5, 0, 0]}")
    moved = highlight(
        "grain: {centre: [0, 0, 0.25]}, transform: {rotate: [0, 90, 0], scale: 2}",
    )
    np.testing.assert_allclose(moved, here, rtol=1e-3, atol=1e-5)


def test_a_grain_costs_no_uv(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.format(more="grain: [1, 0, 0]", mesh=DISC))
    loaded = load(path)
    steps = planned(loaded)
    assert "uv_tangents" not in {step.output for step in steps.once}
    path.write_text(
        SCENE.format(more="grain: [1, 0, 0]", mesh=DISC)
        .replace("alpha_x: 0.05, alpha_y: 0.4", "")
        .replace("ward", "lambert")
        .replace(", specular: 0.3,", "")
    )
    loaded = load(path)
    assert "t" not in {step.output for step in planned(loaded).tile}
