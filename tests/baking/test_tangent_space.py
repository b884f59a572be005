"""Directions in tangent space: the frame of glTF, mirrored uv, back again."""

from __future__ import annotations

import numpy as np

from illumcli.baking.tangent_space import to_tangent

UP = np.array([[0.0, 0.0, 1.0]])


def test_x_is_towards_u_y_is_up_and_z_is_out():
    u = np.array([[1.0, 0.0, 0.0]])
    direction = np.array([[0.6, 0.64, 0.48]])
    assert to_tangent(direction, UP, u, np.ones(1)).tolist() == direction.tolist()
    assert to_tangent(direction, UP, u, -np.ones(1)).tolist() == [[0.6, -0.64, 0.48]]
    assert to_tangent(UP, UP, u, np.ones(1)).tolist() == [[0, 0, 1]]


def test_a_shader_gets_the_direction_back():
    random = np.random.default_rng(0)
    direction, n, tangent = (random.normal(size=(50, 3)) for _ in range(3))
    direction, n = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (direction, n))
    sign = random.choice([-1.0, 1.0], 50)
    x, y, z = to_tangent(direction, n, tangent, sign).T[:, :, None]
    t = tangent - (tangent * n).sum(axis=1, keepdims=True) * n
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    np.testing.assert_allclose(x * t + y * sign[:, None] * np.cross(n, t) + z * n, direction, atol=1e-12)
