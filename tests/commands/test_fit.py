"""`illum fit`: a material on stdout that a scene takes, the rest on stderr."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from fitting.recovery import asked, measured, truth_of
from illumcli.errors import InputError
from illumcli.fitting.fit import SCIPY, fit_model
from illumcli.fitting.material import name_of, shown
from illumcli.images.reader import read_image
from illumcli.scene.load import load

CASE = "oren_nayar"


@pytest.fixture
def table(tmp_path):
    """A noisy table of pairs."""
    m = measured(CASE, 400, 0)
    rows = np.concatenate([m.l, m.v, m.values, m.standard_error, m.weight[:, None]], axis=1)
    names = "lx,ly,lz,vx,vy,vz,R,G,B,error_R,error_G,error_B,weight"
    np.savetxt(tmp_path / "clay 1.csv", rows, "%.9g", ",", header=names, comments="")
    return tmp_path / "clay 1.csv"


def test_stdout_is_a_material_of_a_scene(illum, table, tmp_path):
    done = illum("fit", table.name, "--model", "oren_nayar", "-D", "form=full", "-o", "clay.png")
    assert done.returncode == 0, done.stderr
    (material,) = yaml.safe_load(done.stdout)["materials"].items()
    assert material[0] == "clay_1"
    assert list(material[1]) == ["model", "diffuse", "sigma", "form"]
    assert material[1]["sigma"] == pytest.approx(0.4, abs=0.05)
    scene = tmp_path / "s.yaml"
    scene.write_text(f"version: 1\nobjects: [{{mesh: {{shape: box}}, material: clay_1}}]\n{done.stdout}")
    assert load(scene).scene.materials["clay_1"].sigma == material[1]["sigma"]
    assert "400 of 400 pairs" in done.stderr
    assert "cosine, minimised" in done.stderr
    assert done.stderr.endswith("clay.png\n")
    assert read_image(tmp_path / "clay.png")


def test_one_pair_leaves_most_undetermined(illum, tmp_path):
    (tmp_path / "one.csv").write_text("lx,ly,lz,vx,vy,vz,R,G,B\n0.3,0,0.9,0.1,0.2,0.9,0.2,0.1,0.3\n")
    done = illum("fit", "one.csv", "--model", "phong")
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr
    assert "# not determined by the measurement: specular.R, specular.B, exponent\n" in done.stdout
    assert yaml.safe_load(done.stdout)["materials"]["one"]["diffuse"] == [0.2, 0.1, 0.3]


def test_json_and_several_models(illum, table):
    done = illum(
        "fit", table.name, "--model", "oren_nayar", "--model", "lambert", "--json", "--metric", "log"
    )
    rough, plain = json.loads(done.stdout)
    assert [rough["model"], plain["model"]] == ["oren_nayar", "lambert"]
    assert rough["metrics"]["log"] < plain["metrics"]["log"]
    assert rough["pairs"] == 400
    assert 0.8 < rough["chi_squared"] < 1.2 < plain["chi_squared"]
    assert any("does not describe the measurement" in note for note in plain["notes"])
    assert list(plain["materials"]) == ["clay_1_lambert"]
    (sigma,) = (each for each in rough["parameters"] if each["name"] == "sigma")
    assert abs(sigma["value"] - 0.4) < 4.5 * sigma["standard_error"]
    assert "* the best model by this metric" in done.stderr


@pytest.mark.parametrize(
    ("words", "fact"),
    [
        (("--model", "oren_nayer"), "no model 'oren_nayer'; did you mean 'oren_nayar'?"),
        (("--model", "lambert", "-D", "sigma=1"), "-D sigma=1: no model or parameter 'sigma'"),
        (("--model", "merl", "-D", "file=a.binary"), "merl: has no parameter to fit"),
        (("--model", "lambert", "--lobes", "2"), "models with several: lafortune"),
        (("--model", "lambert", "-o", "x.txt"), "a picture of a fit is written as .png or .svg or .pdf"),
        (("--model", "lambert", "-D", "diffuse={vertex: a}"), "varies over the surface"),
    ],
)
def test_refusals(illum, table, words, fact):
    done = illum("fit", table.name, *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert fact in done.stderr


def test_a_picture_is_not_replaced(illum, table, tmp_path):
    (tmp_path / "x.png").write_text("mine")
    done = illum("fit", table.name, "--model", "lambert", "-o", "x.png")
    assert done.returncode == 5
    assert (tmp_path / "x.png").read_text() == "mine"


def test_without_scipy_the_way_out_is_said(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(InputError, match=r"pip install 'illumcli\[fit\]'") as refused:
        fit_model(asked(CASE), measured(CASE, 50, 0))
    assert str(refused.value) == SCIPY


def test_values_have_a_digit_more_than_their_error():
    assert shown(0.123456789, 0.0012) == 0.1235
    assert shown(123.456789, 3.0) == 123.5
    assert shown(0.5, np.inf) == 0.5
    assert shown(1 / 3, np.nan) == 0.33333
    assert shown(0.0, 0.1) == 0


def test_names_of_materials():
    assert name_of("gold paint-2") == "gold_paint-2"
    assert name_of("3m") == "_3m"


def test_rounding_costs_no_more_than_a_tenth_of_an_error():
    fit = fit_model(asked(CASE), measured(CASE, 400, 1))
    (sigma,) = fit.parameters.coordinates(fit.model)[-1:]
    assert abs(sigma - fit.optimum.x[-1]) <= 0.1 * fit.uncertainty.standard_error[-1]
    assert abs(sigma - truth_of(CASE).sigma) < 0.1
