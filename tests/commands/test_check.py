"""`illum check` prints every problem of every file, and nothing else."""

from __future__ import annotations

import subprocess
import sys

import pytest

from illumcli.commands.check import check_scenes
from illumcli.commands.schema import schema_text

GOOD = "version: 1\nmeshes: {a: {shape: sphere}}\nobjects: [{mesh: a}]\n"


@pytest.fixture
def scenes(tmp_path):
    texts = {
        "good": GOOD,
        "bad": GOOD + "seed: -1\nfilm: {width: 0}\n",
        "worse": "version: 2\nobjects: [{mesh: b}]\n",
        "lacking": "version: 1\nobjects: [{mesh: none.obj}]\n",
    }
    paths = {name: tmp_path / f"{name}.yaml" for name in texts}
    for name, text in texts.items():
        paths[name].write_text(text)
    return paths


def test_every_problem_of_every_file(scenes):
    checks = check_scenes(list(scenes.values()))
    valid, problems = checks.valid, checks.problems
    assert valid == [scenes["good"]]
    assert [line.replace(f"{scenes['bad'].parent}/", "") for line in problems] == [
        "bad.yaml:4:1: seed: must be at least 0, is -1",
        "bad.yaml:5:8: film.width: must be at least 1, is 0",
        "worse.yaml:1:1: version: must be 1, is 2",
        "worse.yaml:2:12: objects.0.mesh: no mesh 'b'; the scene has no meshes",
        "lacking.yaml:2:12: objects.0.mesh: no file none.obj",
    ]


def test_a_fault_of_an_override_is_said_once(scenes):
    checks = check_scenes([scenes["good"], scenes["good"]], ["film.width=0"])
    valid, problems = checks.valid, checks.problems
    assert (valid, problems) == ([], ["-D film.width=0: must be at least 1, is 0"])


def test_the_command(scenes):
    done = subprocess.run(
        [sys.executable, "-m", "illumcli", "check", scenes["good"], scenes["bad"], "-D", "film.samples=1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, f"{scenes['good']}: ok\n")
    assert len(done.stderr.splitlines()) == 2


def test_allowed_folders_by_option(scenes, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "a.obj").write_text("v 0 0 0\n")
    deep = tmp_path / "x" / "y" / "s.yaml"
    deep.parent.mkdir(parents=True)
    deep.write_text("version: 1\nobjects: [{mesh: ../../far/a.obj}]\n")
    command = [sys.executable, "-m", "illumcli", "check", deep]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 2
    allowed = [*command, "--allow", tmp_path / "far"]
    assert subprocess.run(allowed, capture_output=True, check=False).returncode == 0


def test_what_has_no_effect_is_said_and_no_fault(scenes):
    checks = check_scenes([scenes["good"]], ["film.samples=1", "film.filter={filter: tent}"])
    valid, unused, problems = checks.valid, checks.unused, checks.problems
    assert (valid, problems) == ([scenes["good"]], [])
    assert len(unused) == 1
    assert "a single sample looks through the pixel's centre" in unused[0]


def test_the_schema_file_is_the_schema(root):
    kept = (root / "schemas" / "scene.schema.json").read_text()
    assert kept == schema_text(), "write it anew: illum schema > schemas/scene.schema.json"
