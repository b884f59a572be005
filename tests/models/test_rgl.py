"""RGL: a second evaluation, a known BRDF measured and read again, the azimuth, values below 0."""

from __future__ import annotations

import numpy as np
import pytest

import rgl_files
from illumcli.arrays import column_major, unit
from illumcli.errors import InputError
from illumcli.models._warp import Warp, between
from illumcli.models.rgl import Rgl


@pytest.fixture
def model(tmp_path):
    """Fields -> the model of a file that holds them."""

    def written(fields):
        path = tmp_path / "synthetic.bsdf"
        path.unlink(missing_ok=True)
        path.write_bytes(rgl_files.tensor_file(fields))
        return Rgl(file=str(path))

    return written


def pairs(count, least=0.0, seed=4):
    """(count, 3) random eyes and lights above the plane z = 0."""
    random = np.random.default_rng(seed)
    both = unit(column_major(random.normal(size=(2 * count, 3)))) * [1, 1, 0]
    height = least + (1 - least) * random.random(2 * count)
    both *= (np.sqrt(1 - height**2) / np.linalg.norm(both, axis=1))[:, None]
    both[:, 2] = height
    return both[:count], both[count:]


@pytest.mark.parametrize("divided", [1, 0])
@pytest.mark.parametrize("thetas", [rgl_files.THETAS, [0.7]])
def test_noise_is_evaluated_as_point_by_point(model, respond, thetas, divided):
    fields = rgl_files.noise(2, thetas, divided)
    noise = model(fields)
    for eye, light in zip(*pairs(200), strict=True):
        found = respond(noise, {"n": [0, 0, 1], "l": light, "v": eye})
        np.testing.assert_allclose(found, rgl_files.evaluated(fields, eye, light), rtol=1e-9, atol=1e-12)


def test_a_known_brdf_comes_back_at_the_points_of_measurement(model, respond):
    fields = rgl_files.of_known(grid=8, warp=32)
    measured = model(fields)
    compared = 0
    for k, row, column in np.ndindex(7, 8, 8):
        eye, light, u_m = rgl_files.node(fields, k, column / 7, row / 7)
        if light[2] > 1e-3 and 0 < u_m < 1:
            found = respond(measured, {"n": [0, 0, 1], "l": light, "v": eye})
            np.testing.assert_allclose(found, rgl_files.known(eye, light), rtol=2e-5)
            compared += 1
    assert compared > 150


def test_between_the_points_of_measurement_a_known_brdf_is_met_closely(model, respond):
    measured = model(rgl_files.of_known(grid=24, warp=64))
    errors = []
    for eye, light in zip(*pairs(300, least=0.3), strict=True):
        found = respond(measured, {"n": [0, 0, 1], "l": light, "v": eye})
        expected = rgl_files.known(eye, light)
        errors.append(np.abs(found - expected).max() / expected.max())
    assert np.median(errors) < 0.02
    assert np.quantile(errors, 0.95) < 0.15


def test_the_warp_is_inverted(model):
    density = rgl_files.noise(5)["vndf"][0].astype(float)
    x, y = np.random.default_rng(6).random((2, 100))
    for k in (0, 3):
        moved = np.array([rgl_files.warped(density[k], *each) for each in zip(x, y, strict=True)]).T
        angle = between(np.arange(len(density)), np.full(100, float(k)))
        np.testing.assert_allclose(Warp.of(density).invert(angle, *moved), (x, y), atol=1e-12)


def test_turning_the_surface_changes_nothing(model, respond):
    noise = model(rgl_files.noise(3))
    for turn in (0.4, 2.0, 4.0):
        about = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        for eye, light in zip(*pairs(20), strict=True):
            np.testing.assert_allclose(
                respond(noise, {"n": [0, 0, 1], "l": about @ light, "v": about @ eye}),
                respond(noise, {"n": [0, 0, 1], "l": light, "v": eye}),
                rtol=1e-7, atol=1e-9,
            )  # fmt: skip


def test_colours_outside_of_srgb_count_as_0(model, respond):
    fields = rgl_files.noise(1)
    fields["rgb"][:] = -1
    assert not respond(model(fields), {"n": [0, 0, 1], "l": [1, 0, 2], "v": [-1, 1, 2]}).any()


def test_a_changed_file_is_read_again(model, respond):
    directions = {"n": [0, 0, 1], "l": [1, 0, 2], "v": [-1, 1, 2]}
    first = respond(model(rgl_files.noise(1)), directions)
    assert (respond(model(rgl_files.noise(2)), directions) != first).any()


def test_describing_a_measurement_opens_nothing(tmp_path, respond):
    missing = Rgl(file=str(tmp_path / "missing.bsdf"))
    assert missing.lobes()
    with pytest.raises(InputError, match=r"missing\.bsdf: cannot read the measurement"):
        respond(missing, {"n": [0, 0, 1], "l": [1, 0, 2], "v": [-1, 1, 2]})
