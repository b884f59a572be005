"""`illum converge`: true errors, against independent references that estimate their own error."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest

from illumcli.accuracy.convergence import ConvergenceSettings, measure_convergence
from illumcli.accuracy.convergence_table import convergence_table, text_plot
from illumcli.accuracy.curves import Run, curve_through, fit_line, point_of, rmse_of
from illumcli.accuracy.reference import reference_image
from illumcli.accuracy.sampled import Sampling, sampled_layer
from illumcli.errors import InputError
from illumcli.scene.load import load
from ring import RING

SCENE = RING.format(samples=2, ambient=1)


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.setenv("ILLUM_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "ring.yaml"
    path.write_text(SCENE)
    return path


def run(path, **settings):
    return measure_convergence(path, ConvergenceSettings(**settings))


def test_line_finds_slope_and_its_error():
    exact = [(x, 3 - 0.75 * x) for x in (1.0, 2.0, 4.0)]
    assert fit_line(exact) == pytest.approx((-0.75, 0, 3), abs=1e-7)
    # y = x with one point off by 1: slope 1/2, residuals 1/6, -1/3, 1/6
    slope, error, constant = fit_line([(0, 0), (1, 0), (2, 1)])
    assert (slope, constant) == pytest.approx((0.5, -1 / 6))
    assert error == pytest.approx(math.sqrt((1 / 36 + 1 / 9 + 1 / 36) / 1 / 2))
    assert all(math.isnan(value) for value in fit_line([(1, 2), (1, 3)]))
    assert all(math.isnan(value) for value in fit_line([]))


def test_the_references_own_error_is_taken_off():
    truth = np.zeros((2, 2, 1))
    values = np.array([[3, -3], [5, -5]], np.float32)[..., None]
    assert rmse_of(values, truth, 0.0) == pytest.approx(math.sqrt(17))
    assert rmse_of(values, truth, 1.0) == pytest.approx(4)
    assert rmse_of(values, truth, 9.0) == 0


def test_the_reference_errs_as_it_says(scene):
    fine = Sampling(1, 16, "spiral", 0)
    own = sampled_layer(load(scene), "obscurance", threads=1)
    truth, said = reference_image(own, fine, "obscurance", None)
    much_finer, _ = reference_image(own, Sampling(1, 512, "spiral", 0), "obscurance", None)
    assert math.sqrt(np.square(truth - much_finer).mean()) == pytest.approx(said.rmse, rel=0.1)
    assert said.sampling.seed not in {r.seed for r in _runs(scene)}


def _runs(scene):
    found = run(scene, first=4, last=8, samplers=("spiral",), repeats=2, threads=1)
    return [r for p in found.curves[0].points for r in p.runs]


def test_random_rays_fall_by_the_root_and_well_spread_ones_faster(scene):
    found = run(scene, first=8, last=128, repeats=2, threads=2, cache=False)
    slopes = {c.sampler: c.slope for c in found.curves}
    assert slopes["random"] == pytest.approx(-0.5, abs=0.04)
    assert slopes["spiral"] < -0.65
    assert slopes["owen"] < -0.62
    by_random = found.curves[2].count_for(found.curves[0].points[-1].rmse)
    assert by_random > 5 * 128
    for c in found.curves:
        assert [p.count for p in c.points] == [8, 16, 32, 64, 128]
        assert c.points[1].rays > 1.5 * c.points[0].rays


@pytest.mark.parametrize("vary", ["pixels", "both"])
def test_samples_per_pixel_converge_too(scene, vary):
    found = run(scene, vary=vary, first=4, last=32, samplers=("spiral",), repeats=2, threads=2)
    assert found.layer == "beauty"
    assert found.curves[0].slope < -0.5
    assert [p.pixel * p.obscurance for p in found.curves[0].points] == (
        [16, 32, 64, 128] if vary == "pixels" else [4, 8, 16, 32]
    )


def test_errors_are_the_same_for_any_threads_and_the_reference_is_kept(scene):
    once = run(scene, first=4, last=8, samplers=("spiral",), repeats=1, threads=1)
    again = run(scene, first=4, last=8, samplers=("spiral",), repeats=1, threads=3)
    assert [p.rmse for p in once.curves[0].points] == [p.rmse for p in again.curves[0].points]
    assert (once.reference.reused, again.reference.reused) == (False, True)
    assert once.reference.rmse == again.reference.rmse
    other = run(
        scene, overrides=("objects.0.mesh.minor=0.2",), first=4, last=8, samplers=("spiral",), repeats=1
    )
    assert not other.reference.reused


def test_what_cannot_be_measured_is_refused(scene):
    for words, fact in (
        ({"overrides": ("obscurance=null",), "vary": "obscurance"}, "no obscurance to vary"),
        ({"vary": "obscurance", "layer": "light:point1"}, "no layer"),
        ({"vary": "obscurance", "layer": "point1"}, "casts no obscurance ray"),
        ({"vary": "pixels", "layer": "depth"}, "not a mean"),
        ({"vary": "pixels", "first": 1, "last": 8}, "--from 1"),
        ({"first": 16, "last": 16}, "at least twice"),
        ({"camera": "left"}, "no camera 'left'; there are: main"),
    ):
        with pytest.raises(InputError, match=fact):
            run(scene, **words)


def test_a_single_level_of_no_error_has_no_slope():
    still = curve_through("spiral", [point_of(Sampling(1, 4, "spiral", 0), 4, [Run(0, 1, 10, 0.1, 0.0, "")])])
    assert math.isnan(still.slope)
    assert math.isnan(still.count_for(0.1))
    assert text_plot([still]) == "no error to draw"


def test_the_command_prints_writes_and_draws(illum, scene, tmp_path):
    pytest.importorskip("matplotlib")
    words = ("converge", "ring.yaml", "--to", "16", "--repeats", "2", "--width", "32", "-q")
    done = illum(*words, "--csv", "c.csv", "-o", "c.svg", ILLUM_CACHE=str(tmp_path / "cache"))
    assert (done.returncode, done.stderr) == (0, "")
    assert "slope spiral: -0." in done.stdout
    assert "random needs" in done.stdout
    rows = list(csv.DictReader((tmp_path / "c.csv").read_text().splitlines()))
    assert len(rows) == 4 * 3 * 2
    assert {row["sampler"] for row in rows} == {"spiral", "owen", "random", "spiral reconstructed"}
    assert all(float(row["rmse"]) > 0 and float(row["seconds"]) > 0 and int(row["rays"]) > 0 for row in rows)
    assert (tmp_path / "c.svg").read_text().count("<svg") == 1
    data = json.loads(
        illum(*words, "--json", "--sampler", "owen", ILLUM_CACHE=str(tmp_path / "cache")).stdout
    )
    assert [c["sampler"] for c in data["curves"]] == ["owen"]
    assert data["reference"]["reused"] is True
    refused = illum("converge", "ring.yaml", "-o", "c.pdf")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "c.pdf" in refused.stderr


def test_reconstruction_has_a_curve_of_its_own(scene):
    found = run(scene, first=4, last=8, samplers=("spiral", "owen"), repeats=1)
    raw, _, fitted = found.curves
    assert [raw.sampler, fitted.sampler] == ["spiral", "spiral reconstructed"]
    assert [p.rays for p in raw.points] == [p.rays for p in fitted.points]
    assert fitted.points[0].rmse < raw.points[0].rmse
    assert "*" in text_plot(found.curves)
    for settings in ({"reconstruct": False}, {"overrides": ("obscurance.reconstruct=false",)}):
        alone = run(scene, first=4, last=8, samplers=("spiral", "owen"), repeats=1, **settings)
        assert [curve.sampler for curve in alone.curves] == ["spiral", "owen"]
    light = run(scene, vary="pixels", first=2, last=4, layer="alpha", samplers=("spiral",), repeats=1)
    assert len(light.curves) == 1


def test_the_drawing_has_a_mark_per_point(scene):
    found = run(scene, first=4, last=16, samplers=("spiral",), repeats=1)
    assert text_plot(found.curves).partition("RMSE")[0].count("o") == 3
    assert "-  " in convergence_table(found) or " -\n" in convergence_table(
        found
    )  # no spread from a single repeat
