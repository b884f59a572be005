"""Depth cueing: what fades, by how much, and that only the beauty does."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [0, 0, 10], target: [0, 0, 0], fov: 40}
film: {width: 24, height: 16, samples: 1}
ambient: 0.6
materials: {grey: {model: lambert, diffuse: 0.5, emission: [0.1, 0, 0]}}
objects:
  - {mesh: {shape: box, size: [20, 2, 1]}, material: grey, transform: {rotate: [0, 40, 0]}}
outputs: {layers: [beauty, ambient, emission, position, depth]}
"""
CUE = "depth_cue={near: 7, far: 12, strength: 0.8, color: [0.1, 0.2, 0.3]}"


@pytest.fixture
def rendered(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)

    def render(*overrides):
        loaded = load(path, overrides)
        steps = planned(loaded)
        return layers_of(steps), {step.output for step in steps.tile}

    return render


ORTHOGRAPHIC = "camera={projection: orthographic, position: [0, 0, 10], target: [0, 0, 0], extent: 8}"


@pytest.mark.parametrize("camera", ["camera.fov=40", ORTHOGRAPHIC])
def test_the_beauty_fades_linearly_with_the_distance(rendered, camera):
    plain, cued = rendered(camera)[0], rendered(camera, CUE)[0]
    seen = plain["alpha"][..., 0] > 0
    eye = np.array([0, 0, 10])
    distance = np.linalg.norm(plain["position"] - eye, axis=-1)
    if camera == ORTHOGRAPHIC:
        distance = plain["depth"][..., 0].astype(float)
    fade = 0.8 * np.clip((distance - 7) / 5, 0, 1)[..., None]
    wanted = (1 - fade) * plain["beauty"] + fade * [0.1, 0.2, 0.3]
    np.testing.assert_allclose(cued["beauty"][seen], wanted[seen], rtol=1e-5)
    assert 0 < fade[seen].min() + 1e-9 < 0.4 < fade[seen].max() == 0.8
    for name in ("ambient", "emission", "position", "depth", "alpha"):
        np.testing.assert_array_equal(cued[name], plain[name])
    assert not cued["beauty"][~seen].any()


def test_without_one_nothing_is_added_to_the_plan(rendered):
    assert "uncued" not in rendered()[1]
    assert "uncued" in rendered(CUE)[1]


def test_near_lies_before_far(rendered):
    with pytest.raises(InputError, match="near must be below far, is 9 with far 9"):
        rendered("depth_cue={near: 9, far: 9}")
