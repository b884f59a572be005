"""The cone of a spot light, from hair-thin ones to the whole sphere."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.lights.spot import Spot
from illumcli.render_space import RenderSpace

FRAME = RenderSpace((0.0, 0.0, 0.0), 1.0)
HEIGHT = 1000.0
ANGLES = (1e-6, 1e-4, 0.01, 0.1, 1.0, 30.0, 89.0)  # degrees


def cone(angle: float, softness: float, theta: np.ndarray) -> np.ndarray:
    """(N,) strength on the floor below a spot, at angles to its axis [rad]."""
    light = {"light": "spot", "position": [0, HEIGHT, 0], "attenuation": {"law": "none"}}
    spot = Spot.model_validate({**light, "angle": angle, "softness": softness})
    floor = np.zeros((len(theta), 3), np.float32, order="F")
    floor[:, 0] = HEIGHT * np.tan(theta)
    return spot.sample_at(floor, FRAME).irradiance_scale


@pytest.mark.parametrize("angle", ANGLES)
def test_hard_cone_ends_at_its_angle(angle):
    theta = np.radians(angle) * np.array([0, 0.5, 0.999, 1.001, 1.5 if angle < 50 else 1.01])
    assert cone(angle, 0, theta).tolist() == [1, 1, 1, 0, 0]


@pytest.mark.parametrize("softness", [0.01, 0.2, 1.0])
@pytest.mark.parametrize("angle", ANGLES)
def test_soft_rim_is_a_smooth_step_in_the_cosine(angle, softness):
    rim = np.radians(angle)
    full = rim * (1 - softness)
    theta = full + (rim - full) * np.array([0.1, 0.5, 0.9])
    # differences of cosines as products of sines, which lose nothing
    x = np.sin((rim + theta) / 2) * np.sin((rim - theta) / 2)
    x /= np.sin((rim + full) / 2) * np.sin((rim - full) / 2)
    rounded = 2.0**-23 / softness * 10  # of the single-precision floor, in shares of the rim
    np.testing.assert_allclose(cone(angle, softness, theta), x * x * (3 - 2 * x), rtol=0, atol=rounded)


def test_cone_of_180_degrees_is_everything():
    every = {"light": "spot", "position": [0, 1, 0], "angle": 180, "softness": 0}
    points = np.array([[0, 0, 0], [5, 1, 0], [0, 9, 0], [0.1, 9, 0.3]], np.float32, order="F")
    assert (Spot.model_validate(every).sample_at(points, FRAME).irradiance_scale > 0).all()
