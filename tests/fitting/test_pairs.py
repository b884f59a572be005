"""Pairs of directions: cells of MERL tables, and tables of directions."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import cross, dot
from illumcli.errors import InputError
from illumcli.fitting.measurement import STEEPEST, read_measurement
from illumcli.fitting.merl_pairs import drawn_strata
from illumcli.measured_files import merl
from illumcli.models.merl import rusinkiewicz

CAP = np.cos(np.radians(STEEPEST))


def test_directions_lie_in_their_cells():
    strata = drawn_strata()
    s, n = strata.l + strata.v, np.broadcast_to([0.0, 0.0, 1.0], strata.l.shape)
    angles = rusinkiewicz(cross(n, s), s[:, 2], n, strata.l - strata.v, dot(s, s))
    np.testing.assert_array_equal(merl.cell_numbers(*angles)[3], strata.cell)
    np.testing.assert_allclose(dot(strata.l, strata.l), 1)


def test_weights_are_those_of_pairs_of_solid_angles():
    """Means over pairs of caps are products of means over a cap: (1 + cos) / 2."""
    means = []
    for seed in range(12):
        strata = drawn_strata(seed)
        weight = strata.weight / strata.weight.sum()
        z_l, z_v = strata.l[:, 2], strata.v[:, 2]
        azimuth = strata.l[:, 0] * strata.v[:, 0] + strata.l[:, 1] * strata.v[:, 1]
        means.append([weight @ z_l, weight @ z_v, weight @ (z_l * z_v), weight @ azimuth])
    mean, error = np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / np.sqrt(len(means))
    expected = np.array([(1 + CAP) / 2, (1 + CAP) / 2, ((1 + CAP) / 2) ** 2, 0])
    assert np.all(np.abs(mean - expected) < 4.5 * error), (mean - expected) / error


def test_cells_without_measurement_are_left_out(tmp_path):
    table = np.full((3, *merl.SHAPE), 0.25)
    table[1, :, :, :90] = np.nan
    path = tmp_path / "half.binary"
    path.write_bytes(merl.encode(table))
    measurement = read_measurement(path)
    np.testing.assert_allclose(measurement.values, 0.25)
    assert 0.45 < len(measurement.values) / len(drawn_strata().cell) < 0.55
    assert measurement.weight.sum() == pytest.approx(1)
    assert measurement.is_isotropic


TABLE = """\
theta_l,phi_l,lab,theta_v,phi_v,R,G,B,error_R,error_G,error_B,weight
30,0,x,40,180,0.1,0.2,0.3,0.01,0.01,0.01,1
85,0,y,40,180,0.1,0.2,0.3,0.01,0.01,0.01,1

10,90,z,0,0,0.4,0.5,0.6,0.02,0.02,0.02,3
"""


def test_a_table_of_angles(tmp_path):
    (tmp_path / "t.csv").write_text(TABLE)
    measurement = read_measurement(tmp_path / "t.csv")
    sin, cos = np.sin(np.radians(30)), np.cos(np.radians(30))
    np.testing.assert_allclose(measurement.l[0], [sin, 0, cos], atol=1e-15)
    np.testing.assert_allclose(
        measurement.l[1], [0, np.sin(np.radians(10)), np.cos(np.radians(10))], atol=1e-15
    )
    np.testing.assert_allclose(measurement.values, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    np.testing.assert_allclose(measurement.weight, [0.25, 0.75])
    assert measurement.standard_error.tolist() == [[0.01] * 3, [0.02] * 3]
    assert not measurement.is_isotropic


def test_a_table_of_vectors(tmp_path):
    (tmp_path / "t.csv").write_text("R,G,B,lx,ly,lz,vx,vy,vz\n1,2,3,0,0,2,1,0,1\n")
    measurement = read_measurement(tmp_path / "t.csv")
    np.testing.assert_allclose(measurement.l, [[0, 0, 1]])
    np.testing.assert_allclose(measurement.v, [[np.sqrt(0.5), 0, np.sqrt(0.5)]])
    assert measurement.standard_error is None


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("", "must have a line of names"),
        ("lx,ly,lz,vx,vy,vz,R,G\n0,0,1,0,0,1,1,1\n", "has no column B"),
        ("lx,ly,lz,R,G,B\n0,0,1,1,1,1\n", "has no column vx, vy, vz"),
        (TABLE.replace("0.4,", "much,"), "t.csv:5: must have 12 numbers"),
        (TABLE.replace("0.4,", "nan,"), "t.csv:5: has a number that is not finite"),
        (TABLE.replace("0.4,", "1e300,"), r"t.csv:5: R, G, B must be at most 1e\+18"),
        (TABLE.replace(",0.02,3", ",0,3"), "t.csv:5: standard errors must be above 0"),
        (TABLE.replace(",3\n", ",-3\n"), "t.csv:5: weight must be at least 0"),
        ("lx,ly,lz,vx,vy,vz,R,G,B\n0,0,0,0,0,1,1,1,1\n", "t.csv:2: l has no direction"),
        ("lx,ly,lz,vx,vy,vz,R,G,B\n0,0,-1,0,0,1,1,1,1\n", "has no pair"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, fact):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError, match=fact):
        read_measurement(tmp_path / "t.csv")


def test_other_files_are_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"is a MERL file \(\.binary\), an RGL file \(\.bsdf\), a table of illum measure"
    ):
        read_measurement(tmp_path / "t.xyz")
    with pytest.raises(InputError, match="cannot read the measurement"):
        read_measurement(tmp_path / "none.csv")
