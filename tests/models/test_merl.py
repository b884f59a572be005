"""MERL: published angles and indices, look-ups in a synthetic table, files that are not one."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.measured_files.merl import CELLS, SCALE, SHAPE, cell_numbers, coordinates
from illumcli.models.merl import Merl, rusinkiewicz

SLANTED = {"n": [0, 0, 1], "l": [1, 0.3, 1], "v": [-0.2, -0.6, 1]}


def written(path, table):
    """A MERL file of a (3, 90, 90, 180) table."""
    with open(path, "wb") as file:
        file.write(np.array(SHAPE, "<i4").tobytes())
        file.write(np.asarray(table, "<f8").tobytes())
    return str(path)


@pytest.fixture(scope="module")
def smooth(tmp_path_factory):
    """A table that is linear in the cell numbers, apart from phi_d, which goes round."""
    i, j, k = (np.arange(count) + 0.5 for count in SHAPE)
    plane = 100 + i[:, None, None] + 2 * j[None, :, None] + 10 * np.cos(2 * np.pi * k / 180)
    table = plane / np.array(SCALE)[:, None, None, None]
    return written(tmp_path_factory.mktemp("merl") / "smooth.binary", table)


def angles(words, term):
    nxs, n_s, d, s_s = (term(name, **words) for name in ("nxs", "n_s", "d", "s_s"))
    return rusinkiewicz(nxs, n_s, words["n"], d, s_s)


def test_published_angles(cases, frame, term, agree):
    for case in cases("rusinkiewicz_theta"):
        agree([each[0] for each in angles(frame(case["inputs"]), term)[:2]], case)
    for case in cases("rusinkiewicz"):
        words = frame(case["inputs"])
        theta_h, theta_d, phi_d = (each[0] for each in angles(words, term))
        phi_h = np.arctan2(term("b_s", **words), term("t_s", **words))[0]
        expected = np.array(case["expected"])
        turns = np.round((np.array([theta_h, phi_h, theta_d, phi_d]) - expected) / (2 * np.pi)) * [0, 1, 0, 1]
        agree(np.array([theta_h, phi_h, theta_d, phi_d]) - 2 * np.pi * turns, case)


def test_published_indices(cases, agree):
    for case in cases("merl_index"):
        i = case["inputs"]
        agree([int(each) for each in cell_numbers(i["theta_h"], i["theta_d"], i["phi_d"])], case)


def test_nearest_takes_the_cell_itself(smooth, respond, brdf, frame, term):
    i, j, k, _ = (int(each[0]) for each in cell_numbers(*angles(frame(SLANTED), term)))
    expected = 100 + i + 0.5 + 2 * (j + 0.5) + 10 * np.cos(2 * np.pi * (k + 0.5) / 180)
    np.testing.assert_allclose(brdf(Merl(file=smooth, lookup="nearest"), SLANTED), expected, rtol=1e-12)


def test_linear_lies_between_the_cells(smooth, brdf, frame, term):
    i, j, k = (each[0] for each in coordinates(*angles(frame(SLANTED), term)))
    expected = 100 + i + 2 * j + 10 * np.cos(2 * np.pi * k / 180)
    np.testing.assert_allclose(brdf(Merl(file=smooth), SLANTED), expected, rtol=1e-4)


@pytest.mark.parametrize("lookup", ["nearest", "linear"])
def test_what_was_not_measured_is_black(tmp_path, respond, lookup):
    nothing = written(tmp_path / "nothing.binary", np.full((3, CELLS), -1.0))
    assert not respond(Merl(file=nothing, lookup=lookup), SLANTED).any()


def test_interpolation_leaves_out_what_was_not_measured(tmp_path, brdf):
    table = np.full((3, *SHAPE), 1500.0)
    table[:, ::2] = -1
    striped = written(tmp_path / "striped.binary", table)
    np.testing.assert_allclose(
        brdf(Merl(file=striped, lookup="linear"), SLANTED), [1, 1.15, 1.66], rtol=1e-12
    )


@pytest.mark.parametrize("lookup", ["nearest", "linear"])
def test_swapping_light_and_eye_keeps_the_value(smooth, brdf, lookup):
    model = Merl(file=smooth, lookup=lookup)
    swapped = SLANTED | {"l": SLANTED["v"], "v": SLANTED["l"]}
    np.testing.assert_allclose(brdf(model, SLANTED), brdf(model, swapped), rtol=1e-12)


@pytest.mark.parametrize(
    ("content", "fact"),
    [
        (b"\0" * 40, "must begin with the sizes 90, 90, 180"),
        (np.array(SHAPE, "<i4").tobytes(), "bytes, has 12"),
    ],
)
def test_other_files_are_refused(tmp_path, respond, content, fact):
    path = tmp_path / "other.binary"
    path.write_bytes(content)
    with pytest.raises(InputError, match=fact):
        respond(Merl(file=str(path)), SLANTED)


def test_describing_a_measurement_opens_nothing(tmp_path, respond):
    missing = Merl(file=str(tmp_path / "missing.binary"))
    assert missing.lobes()
    with pytest.raises(InputError, match=r"missing\.binary: cannot read"):
        respond(missing, SLANTED)
