"""`illum verify`: passing cases, failing cases, and messages about wrong files."""

from __future__ import annotations

import gzip
import json
import lzma
import os
import shlex
import signal
import sys

import pytest

from illumcli import verification as job
from illumcli.cli import main
from illumcli.errors import InputError, ThresholdError
from illumcli.schema.sources import own_tags
from illumcli.verification.obscurance import CAST
from illumcli.verification.vectors import OPENERS


def packaged():
    """The cases of the package's files."""
    for file in sorted(job.PACKAGED.iterdir()):
        with OPENERS.get(file.suffix, open)(file) as text:
            yield from json.load(text)


ENTRIES = list(packaged())
TYPES = {entry["model"] for entry in ENTRIES}
LAMBERT = {
    "id": "mine",
    "model": "lambert_brdf",
    "inputs": {"albedo": 0.5, "n": [0, 0, 1], "l": [1, 0, 2], "v": [0, 1, 5]},
    "expected": 0.15915494309189535,
    "rtol": 1e-12,
    "atol": 0,
}


@pytest.fixture
def write(tmp_path):
    """Puts cases into a file."""

    def to(entries, name="vectors.json"):
        path = tmp_path / name
        path.write_text(entries if isinstance(entries, str) else json.dumps(entries))
        return path

    return to


@pytest.fixture
def illum_verify(monkeypatch, capfd):
    """Runs the command as a shell does: status, stdout, stderr."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["illum", "verify", *map(str, words)])
        monkeypatch.setattr(os, "_exit", sys.exit)
        for name in ("stdout", "stderr"):  # which the command makes its own
            monkeypatch.setattr(sys, name, getattr(sys, name))
        monkeypatch.setattr(signal, "signal", lambda number, handler: None)
        with pytest.raises(SystemExit) as stop:
            main()
        return (stop.value.code, *capfd.readouterr())

    return call


def changed(entry):
    """The case with an expected value just beyond what its tolerance lets pass."""
    values = entry["expected"] if isinstance(entry["expected"], list) else [entry["expected"]]
    scale = max(map(abs, values))
    away = 0.02 if entry["model"] in CAST else 3 * (entry["rtol"] + 1e-12) * scale + 3 * entry["atol"]
    moved = [values[0] + (away if entry["model"] != "merl_index" else 1), *values[1:]]
    return entry | {"expected": moved}


def one_per_type():
    """A case of every type in the package's file, the first whose expected value is not 0."""
    chosen = {}
    for entry in ENTRIES:
        values = entry["expected"] if isinstance(entry["expected"], list) else [entry["expected"]]
        if any(values):
            chosen.setdefault(entry["model"], entry)
    return list(chosen.values())


def problems(call):
    with pytest.raises(InputError) as stop:
        call()
    return list(stop.value.problems)


def test_every_vector_of_the_package_passes():
    rows = job.verify()
    job.refuse_failures(rows)
    assert sum(len(row.outcomes) for row in rows) == len(ENTRIES) >= 1729
    assert {row.type for row in rows} == TYPES >= set(job.EVALUATORS)


def test_every_model_has_vectors_of_its_parameters():
    """Measurements are compared with the readers' own references: their values are in a file."""
    measured = {"merl", "rgl"}
    covered = {entry["model"] for entry in ENTRIES if "parameters" in entry["inputs"]}
    assert set(own_tags("illumcli.models")) - measured == covered - measured


def test_float64_keeps_twelve_digits_wherever_the_inputs_do():
    exact = {entry["id"] for entry in ENTRIES if entry["rtol"] <= 1e-12}
    rows = job.verify(only=sorted(TYPES - set(CAST)))
    errors = {o.case.id: o.error for row in rows for o in row.outcomes if o.case.id in exact}
    assert len(errors) > 1000
    assert max(errors.values()) <= 1e-12


def test_a_wrong_expected_value_is_caught_in_every_type(write):
    rows = job.verify(write([changed(entry) for entry in one_per_type()]))
    assert {row.type for row in rows} == TYPES
    assert [row.type for row in rows if not row.failed] == []
    with pytest.raises(ThresholdError, match=f"and {len(TYPES) - 10} more"):
        job.refuse_failures(rows)


PARAMETERS = {"diffuse": [0.1, 0.5, 1.0], "specular": 0.2, "exponent": 4}
PHONG = {
    "id": "any-model",
    "model": "phong",
    "inputs": {"parameters": PARAMETERS, "n": [0, 0, 1], "l": [0, 0, 2], "v": [0, 0, 1]},
    "expected": [0.3, 0.7, 1.2],
    "rtol": 1e-15,
    "atol": 0,
}


def test_parameters_of_a_scene_verify_any_model(write):
    (row,) = job.verify(write([PHONG]), ["phong"])
    assert row.failed == []
    (row,) = job.verify(write([PHONG | {"expected": [0.3, 0.7, 1.21]}]))
    assert row.failed == ["any-model"]
    below = PHONG | {"inputs": PHONG["inputs"] | {"v": [1, 0, -1]}, "expected": [0, 0, 0]}
    assert job.verify(write([below]))[0].failed == []


def test_a_folder_of_files_is_verified_as_one(write, tmp_path):
    write([PHONG], "a.json")
    write([LAMBERT], "b.json")
    assert [row.type for row in job.verify(tmp_path)] == ["phong", "lambert_brdf"]
    write([PHONG | {"model": "phng"}], "c.json")
    assert "c.json: no case type 'phng'" in problems(lambda: job.verify(tmp_path))[0]


def test_status_is_0_within_tolerance_and_3_beyond(write, illum_verify):
    status, out, err = illum_verify(write([LAMBERT]))
    assert (status, err) == (0, "")
    assert out.splitlines()[1].split()[:2] == ["lambert_brdf", "1"]
    assert out.splitlines()[-1] == "1 case of 1 type: all within their tolerance"
    status, out, err = illum_verify(write([LAMBERT, changed(LAMBERT) | {"id": "bad"}]))
    assert status == 3
    assert out.splitlines()[1].split()[-2:] == ["1", "beyond"]
    assert err == "beyond their tolerance: bad\n"


@pytest.mark.parametrize("opener", [gzip.open, lzma.open])
def test_compressed_files_are_read_by_their_suffix(tmp_path, opener):
    path = tmp_path / f"v.json.{'gz' if opener is gzip.open else 'xz'}"
    with opener(path, "wt") as file:
        json.dump([LAMBERT], file)
    assert not job.verify(path)[0].failed


def test_only_looks_at_these_types(illum_verify):
    status, out, _ = illum_verify("--only", "lerp", "--only", "mu", "--json")
    assert status == 0
    assert [row["type"] for row in json.loads(out)["types"]] == ["lerp", "mu"]
    status, _, err = illum_verify("--only", "lerpp")
    assert (status, err) == (2, "--only lerpp: no such case type; did you mean 'lerp'?\n")


def test_an_unknown_type_names_its_cases(write):
    path = write(
        [
            LAMBERT,
            LAMBERT | {"id": "a", "model": "lambert_brfd"},
            LAMBERT | {"id": "b", "model": "lambert_brfd"},
        ]
    )
    assert problems(lambda: job.verify(path)) == [
        f"{path}: no case type 'lambert_brfd' (a, b); did you mean 'lambert_brdf'?"
    ]
    assert not job.verify(path, ["lambert_brdf"])[0].failed


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("[{]", ":1:3: is not JSON: Expecting property name enclosed in double quotes"),
        ('{"id": 1}', ": must be a list of cases, is an object"),
        ("[]", ": holds no case"),
        ("[3]", ": case 1: must be an object, is 3"),
        ('[{"id": "x", "model": "mu"}]', ": case 1 (x): lacks inputs, expected, rtol, atol"),
        ("[NaN]", ": holds NaN, which is not a number of JSON"),
    ],
)
def test_a_malformed_file_is_told_where_and_what(write, text, fact):
    path = write(text)
    assert problems(lambda: job.verify(path)) == [f"{path}{fact}"]


def test_all_problems_of_a_file_come_at_once(write):
    path = write([LAMBERT | {"rtol": -1, "expected": "much"}, {}, LAMBERT, LAMBERT | {"inputs": [1]}])
    assert problems(lambda: job.verify(path)) == [
        f"{path}: case 1 (mine): expected: must be a number or a list of numbers, is the text 'much'",
        f"{path}: case 1 (mine): rtol: must be a number of at least 0, is -1",
        f"{path}: case 2: lacks id, model, inputs, expected, rtol, atol",
        f"{path}: case 4 (mine): inputs: must be an object, is a list",
    ]


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        ({"albedo": None}, "inputs 'albedo' must be a number or 3 numbers, is None"),
        ({"l": [1, 2]}, "inputs 'l' must be 3 numbers, is [1, 2]"),
        ({"l": [0, 0, 0]}, "inputs 'l' must not be the zero vector"),
        ({"albedo": 1.5}, "diffuse.value.0: Input should be less than or equal to 1"),
    ],
)
def test_inputs_that_a_formula_does_not_take(write, change, fact):
    path = write([LAMBERT | {"inputs": LAMBERT["inputs"] | change}])
    assert f"{path}: mine: {fact}" in problems(lambda: job.verify(path))


def test_a_missing_input_and_an_unknown_kind(write):
    path = write([LAMBERT | {"inputs": {"albedo": 1.0}}])
    assert problems(lambda: job.verify(path)) == [f"{path}: mine: inputs lack 'n'"]
    path = write([LAMBERT | {"model": "attenuation", "inputs": {"kind": "inverse_sqare", "d": 1}}])
    assert problems(lambda: job.verify(path)) == [
        f"{path}: mine: no kind 'inverse_sqare'; did you mean 'inverse_square'?"
    ]


def test_a_file_that_is_not_there(tmp_path, illum_verify):
    status, out, err = illum_verify(tmp_path / "none.json")
    assert (status, out) == (2, "")
    assert err == f"{tmp_path / 'none.json'}: cannot be read: No such file or directory\n"


def test_a_result_that_is_no_number_fails(write):
    endless = {"kind": "inverse_square", "d": 1e-200}
    path = write([LAMBERT | {"model": "attenuation", "inputs": endless, "expected": 1.0}])
    rows = job.verify(path)
    assert rows[0].failed == ["mine"]
    assert "inf" in job.as_table(rows)


def test_single_precision_tells_where_digits_go(illum_verify):
    status, out, _ = illum_verify(
        "--precision", "single", "--only", "cook_torrance", "--only", "lambert_brdf"
    )
    assert status == 0
    assert "above 1e-05" in out.splitlines()[0]
    assert "n.l=" in out
    count = sum(entry["model"] in ("cook_torrance", "lambert_brdf") for entry in ENTRIES)
    assert out.splitlines()[-1].startswith(f"{count} cases of 2 types in float32: ")


def test_single_precision_names_the_cause(write):
    sharp = LAMBERT | {
        "id": "sharp",
        "model": "ndf",
        "inputs": {"D": {"kind": "beckmann", "m": 0.001}, "n": [0, 0, 1], "h": [0.003, 0.001, 1]},
        "expected": 14.45,
        "rtol": 1e-2,
    }
    far = LAMBERT | {
        "id": "far",
        "model": "attenuation",
        "inputs": {"kind": "inverse_square", "d": 1e22},
        "expected": 1e-44,
    }
    rows = job.verify_single(write([sharp, far, LAMBERT]))
    causes = {loss.outcome.case.id: loss for row in rows for loss in row.losses}
    assert set(causes) == {"sharp", "far"}
    assert causes["far"].cause == "range"
    assert causes["sharp"].inputs == "D(beckmann m=0.001) n.h=1"


def test_float32_arithmetic_itself_loses_next_to_nothing():
    rows = job.verify_single()
    own = [loss for row in rows for loss in row.losses if loss.cause == "arithmetic"]
    assert len(own) <= 5
    assert max(loss.outcome.error for loss in own) < 3e-5


def test_values_drawn_as_0_name_the_command_that_checks_them(illum, tmp_path):
    (tmp_path / "my own").mkdir()
    (tmp_path / "my own" / "dark.py").write_text(
        '''"""Dark."""

from typing import Literal

from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import tint


class Dark(IlluminationModel):
    model: Literal["dark"] = "dark"

    def diffuse_lobe(self, n_l):
        return tint((1.0, 1.0, 1.0), n_l - 2)
'''
    )
    (tmp_path / "s.yaml").write_text(
        "version: 1\nobjects: [{mesh: {shape: sphere}, material: {model: dark}}]\n"
        "lights: [{light: directional, direction: [-1, -1, -2], irradiance: 3}]\n"
        "film: {width: 8, height: 8}\n"
    )
    done = illum("render", "s.yaml", "--models", "my own", "--no-cache", "-o", "x.png")
    assert done.returncode == 0, done.stderr
    said, command = done.stderr.rstrip("\n").split("; see ")
    assert "were negative or not finite, and are 0" in said
    assert command == "illum verify s.yaml --models 'my own'"
    assert illum(*shlex.split(command)[1:]).returncode == 3
