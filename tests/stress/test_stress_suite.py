"""The stability suite: every case passes, and each kind of check finds the fault it is for."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.errors import ThresholdError
from illumcli.models.lambert import Lambert
from illumcli.stress import models, rays, sandbox, scenes, suite


@pytest.fixture(scope="module")
def quick():
    return suite.run_suite(quick=True)


def test_every_case_passes(quick):
    assert quick.failed == [], [row for row in quick.rows if not row.passed]
    assert (quick.not_finite, quick.negative) == (0, 0)
    assert quick.values > 1_000_000


@pytest.mark.slow
def test_the_whole_suite_passes():
    result = suite.run_suite()
    assert result.failed == [], [row for row in result.rows if not row.passed]
    assert result.values > 1e8


def test_every_scene_of_the_list_is_there(quick):
    cases = {row.case for row in quick.rows}
    assert set(scenes.MUST_RENDER) | set(scenes.MUST_REFUSE) <= cases
    assert {
        "size and distance",
        "size and distance, baked",
        "powers of two",
        "contact gaps",
        "threads",
        "model: ward",
    } <= cases


def test_the_table_has_a_line_per_case_and_totals(quick):
    lines = suite.suite_table(quick).splitlines()
    assert len(lines) == len(quick.rows) + 3
    assert lines[-1].startswith(f"{len(quick.rows)} of {len(quick.rows)} cases passed")
    assert json.loads(json.dumps(quick.as_data()))["failed"] == []


def test_a_failed_case_is_a_threshold_exceeded(quick):
    bad = sandbox.CheckResult("a case", "what", "1 pixel", False)
    result = suite.SuiteResult((bad,), 1, 1, 1, 0, 0, 0.0)
    assert "FAILED" in suite.suite_table(result)
    with pytest.raises(ThresholdError, match="a case"):
        suite.refuse_failures(result)


def test_faults_name_what_no_picture_may_have():
    good = {"R": np.ones((2, 2)), "N.X": -np.ones((2, 2)), "obscurance.Y": np.ones((2, 2))}
    assert sandbox.faults(good) == []
    bad = {"R": np.array([[np.nan, -1]]), "obscurance.Y": np.array([[1.5]]), "N.X": np.array([[np.inf]])}
    assert sandbox.faults(bad) == [
        "R not finite in 1 pixels",
        "R below 0 in 1 pixels",
        "obscurance.Y above 1 in 1 pixels",
        "N.X not finite in 1 pixels",
    ]


def test_a_scene_that_fails_is_a_row_and_not_the_end(tmp_path, monkeypatch):
    folder = sandbox.Sandbox(tmp_path)
    monkeypatch.setattr(scenes, "MUST_RENDER", {"broken": lambda sandbox: {"film": {"width": -1}}})
    monkeypatch.setattr(scenes, "MUST_REFUSE", {"fine": lambda sandbox: {"film": {"width": 4, "height": 4}}})
    broken, fine = scenes.check_scenes(folder, quick=True)
    assert not broken.passed
    assert "film.width" in broken.worst
    assert (fine.passed, fine.worst) == (False, "rendered")


def test_a_model_that_goes_wrong_is_seen(monkeypatch):
    def wrong(self, n_l):
        return -np.ones((len(n_l), 3), n_l.dtype)

    monkeypatch.setattr(Lambert, "diffuse_lobe", wrong)
    (row,) = [row for row in models.check_models(quick=True) if row.case == "model: lambert"]
    assert not row.passed


def test_an_icosphere_is_closed_smooth_and_faces_outwards():
    ball = rays.icosphere(2)
    assert ball.polygon_count == 320
    corners = ball.vertices[ball.corners.reshape(-1, 3)]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert 4.0 < volume < 4 * np.pi / 3
    edges = np.sort(ball.corners.reshape(-1, 3)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
