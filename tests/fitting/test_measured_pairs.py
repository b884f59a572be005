"""Tables of `illum measure`: isotropic and not, with the errors of their cells."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.fitting.measured_pairs import measured_pairs
from illumcli.gonioreflectometer.table import Table
from illumcli.measured_files import merl


@pytest.fixture
def read(monkeypatch, tmp_path):
    """The pairs of a table, which is in memory."""

    def pairs(brdf, error):
        made = Table(brdf, error, np.zeros(1, np.int32), {})
        monkeypatch.setattr("illumcli.fitting.measured_pairs.read_table", lambda path: made)
        return measured_pairs(tmp_path / "t.npz")

    return pairs


def test_an_isotropic_table_has_the_cells_of_merl(read):
    shape = (3, *merl.SHAPE)
    brdf = np.broadcast_to(np.array([0.1, 0.2, 0.3], np.float32)[:, None, None, None], shape).copy()
    brdf[:, :, :, :90] = np.nan
    found = read(brdf, np.full(shape, 0.01, np.float32))
    np.testing.assert_allclose(found.values, np.tile([0.1, 0.2, 0.3], (len(found.values), 1)), rtol=1e-6)
    assert found.is_isotropic
    assert found.is_noise_common
    assert 20000 < len(found.values) < 25000


def test_directions_of_a_table_with_azimuths_are_those_of_its_cells(read):
    """The values are made from the directions: l.x + 2 v.y."""
    step = 15
    polar, around = 90 // step, 360 // step
    theta, phi = np.radians((np.arange(polar) + 0.5) * step), np.radians((np.arange(around) + 0.5) * step)
    x, y = np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi)
    brdf = np.broadcast_to(x[:, :, None, None] + 2 * y[None, None], (3, polar, around, polar, around))
    found = read(brdf.astype(np.float32), np.full(brdf.shape, 0.1, np.float32))
    np.testing.assert_allclose(found.values[:, 0], found.l[:, 0] + 2 * found.v[:, 1], atol=1e-6)
    assert not found.is_isotropic
    assert found.weight.sum() == pytest.approx(1)
    # cells of equal steps: their solid angle is the sine of the polar angle
    sines = np.hypot(found.l[:, 0], found.l[:, 1]) * np.hypot(found.v[:, 0], found.v[:, 1])
    np.testing.assert_allclose(found.weight / sines, (found.weight / sines)[0])
