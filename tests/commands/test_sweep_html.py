"""`illum sweep --html`: what the report says of each variant, and when it is written."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys

import pytest

from illumcli.html_report.data import data_contents

SCENE = """
version: 1
film: {width: 12, height: 8, samples: 1}
materials:
  clay: {model: blinn_phong, diffuse: 0.5}
objects: [{mesh: {shape: sphere}, material: clay}]
lights: [{light: point, position: [3, 4, 5], intensity: 30}]
"""
VALUES = ("-D", "materials.clay.exponent=8,32", "-D", "film.exposure=dim:-1,0")


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "ball.yaml"
    path.write_text(SCENE)
    return path


def report_data(folder):
    _, _, text = (folder / "data.js").read_text().partition("const REPORT = ")
    return json.loads(text.rstrip().removesuffix(";"))


def test_a_report_has_the_values_and_measures_of_all_variants(illum, scene, tmp_path):
    more = ("--table", "t.csv", "--reference", "1", "--no-cache")
    done = illum("sweep", "ball.yaml", *VALUES, "--html", "report", *more)
    assert done.returncode == 0, done.stderr
    data = report_data(tmp_path / "report")
    assert data["title"] == "ball"
    assert [(each["label"], each["values"]) for each in data["parameters"]] == [
        ("exponent", ["8", "32"]),
        ("exposure", ["dim", "0"]),
    ]
    measures = {each["name"]: each["values"] for each in data["measures"]}
    assert measures["rmse"][0] == 0
    assert measures["rmse"][1] > 0
    assert measures["rays"][0] > 0
    assert data["references"] == [data["pictures"][0][0]] * 4
    assert data["pictureNames"] == ["beauty"]
    names = {name for row in data["pictures"] for name in row}
    assert {path.stem for path in (tmp_path / "report" / "pictures").iterdir()} == names
    assert all((tmp_path / "report" / row[0]).resolve().is_file() for row in data["files"])


@pytest.mark.parametrize(
    "more",
    [
        ("-o", "{materials.clay.exponent} {film.exposure}{layer}.png"),
        ("-o", "f/{frame:03d}-{materials.clay.exponent}-{film.exposure}{layer}.png", "--frames", "2:3"),
    ],
)
def test_the_command_of_a_variant_makes_its_pictures(illum, scene, tmp_path, more):
    words = ("ball.yaml", "--only", "beauty", "--only", "alpha", "--seed", "7", *VALUES, *more)
    done = illum("sweep", *words, "--html", "report")
    assert done.returncode == 0, done.stderr
    pictures = {path: (tmp_path / path).read_bytes() for path in done.stdout.splitlines()}
    for path in pictures:
        (tmp_path / path).unlink()
    for command in report_data(tmp_path / "report")["commands"]:
        done = illum(*shlex.split(command)[1:])
        assert done.returncode == 0, done.stderr
    assert {path: (tmp_path / path).read_bytes() for path in pictures} == pictures


def test_a_report_is_kept_and_shows_what_failed(illum, scene, tmp_path):
    words = ("sweep", "ball.yaml", "-D", "materials.clay.exponent=8,-2,32", "--html", "report")
    done = illum(*words)
    assert done.returncode == 2
    data = report_data(tmp_path / "report")
    assert data["states"] == ["rendered", "failed", "rendered"]
    assert "must be at least 0, is -2" in data["errors"][1]
    assert data["pictures"][1] == [None]
    assert data_contents(tmp_path / "report" / "data.js")[1] == "incomplete"

    # the same without the fault is another report
    words = ("sweep", "ball.yaml", "-D", "materials.clay.exponent=8,32", "--html", "report")
    assert "a different file is there" in illum(*words).stderr
    assert illum(*words, "--force").returncode == 0
    before = (tmp_path / "report" / "data.js").read_bytes()
    os.utime(tmp_path / "report" / "index.html", (0, 0))
    done = illum(*words)
    assert "report/index.html: kept, its content is the same" in done.stderr
    assert (tmp_path / "report" / "data.js").read_bytes() == before
    assert (tmp_path / "report" / "index.html").stat().st_mtime > 0


def test_a_sweep_without_a_report_imports_no_template_library(scene):
    script = "\n".join(
        [
            "import sys",
            "from illumcli.cli import illum",
            "try:",
            "    illum({!r})",
            "except SystemExit as end:",
            "    assert end.code == 0, end.code",
            "print('jinja2' in sys.modules)",
        ]
    )
    pattern = str(scene.parent / "{materials.clay.exponent}{film.exposure}.png")
    words = ["sweep", str(scene), *VALUES, "-o", pattern]
    for more, expected in (([], "False"), (["--html", str(scene.parent / "report")], "True")):
        command = [sys.executable, "-c", script.format([*words, *more])]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == expected
