"""MERL files: directions of cells, and tables that are read as they were written."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import dot
from illumcli.errors import InputError
from illumcli.files.atomic import write_bytes
from illumcli.measured_files import merl
from illumcli.models.merl import Merl, rusinkiewicz


@pytest.fixture(scope="module")
def table():
    """(3, 90, 90, 180) random values, with gaps."""
    values = np.random.default_rng(3).random((3, *merl.SHAPE))
    values[:, ::7, :, ::5] = np.nan
    return values


@pytest.fixture(scope="module")
def path(table, tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "random.binary"
    write_bytes(path, merl.encode(table))
    return path


def terms(l, v):
    """The terms of pairs of directions about z, from which the model computes its angles."""
    s, n = l + v, np.broadcast_to([0.0, 0.0, 1.0], l.shape)
    return {"nxs": np.cross(n, s), "n_s": s[:, 2], "n": n, "d": l - v, "s_s": dot(s, s)}


@pytest.mark.parametrize("row", [0, 1, 37, 89])
def test_the_directions_of_cells_lie_in_their_cells(row):
    l, v = merl.cell_directions(row)
    np.testing.assert_allclose(dot(l, l), 1)
    np.testing.assert_allclose(dot(v, v), 1)
    given = terms(l, v)
    angles = rusinkiewicz(given["nxs"], given["n_s"], given["n"], given["d"], given["s_s"])
    np.testing.assert_array_equal(merl.cell_numbers(*angles)[3], row * 90 * 180 + np.arange(90 * 180))
    for x in merl.coordinates(*angles):
        np.testing.assert_allclose(x % 1, 0.5, atol=1e-9)


def test_a_table_is_read_as_it_was_written(table, path):
    np.testing.assert_allclose(merl.read(path), table, rtol=1e-15)
    numbers = np.frombuffer(path.read_bytes(), "<f8", offset=12)
    np.testing.assert_array_equal(numbers < 0, np.isnan(table).ravel())


def test_the_model_finds_the_value_of_each_cell(table, path):
    l, v = merl.cell_directions(40)
    above = np.flatnonzero((l[:, 2] > 0) & (v[:, 2] > 0))
    given = terms(l[above], v[above])
    expected = np.nan_to_num(table[:, 40].reshape(3, -1)[:, above].T)
    for lookup in ("nearest", "linear"):
        f = Merl(file=str(path), lookup=lookup).specular_lobe(n_l=np.ones(len(above)), **given)
        filled = expected[:, 0] > 0  # elsewhere `linear` takes the neighbours
        np.testing.assert_allclose(f[filled], expected[filled], rtol=1e-9)


@pytest.mark.parametrize("lookup", ["nearest", "linear"])
def test_nan_in_files_of_others_counts_as_no_measurement(tmp_path, lookup):
    path = tmp_path / "nan.binary"
    path.write_bytes(np.array(merl.SHAPE, "<i4").tobytes() + np.full(3 * merl.CELLS, np.nan).tobytes())
    given = terms(*merl.cell_directions(10))
    f = Merl(file=str(path), lookup=lookup).specular_lobe(n_l=np.ones(90 * 180), **given)
    assert not f.any()
    assert np.isnan(merl.read(path)).all()


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"missing\.binary: cannot read the measurement"):
        merl.read(tmp_path / "missing.binary")
