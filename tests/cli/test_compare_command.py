"""`illum compare` on the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from illumcli.cli.compare import compare
from illumcli.errors import InputError, ThresholdError
from illumcli.film.channels import channel_types
from illumcli.images.writer import ImageWriter


@pytest.fixture
def pair(tmp_path):
    paths = []
    for name, value in (("a.exr", 0.25), ("b.exr", 0.5)):
        with ImageWriter(tmp_path / name, 6, 4, channel_types("RGB")) as writer:
            writer.write_band(0, np.full((4, 6, 3), value, np.float32))
        paths.append(str(tmp_path / name))
    return paths


def test_table_goes_to_stdout(pair):
    result = CliRunner().invoke(compare, pair)
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == ["layer", "beauty"]


def test_threshold_is_told_after_the_table(pair):
    result = CliRunner().invoke(compare, [*pair, "--max-rmse", "0.1"])
    assert "beauty" in result.stdout
    assert isinstance(result.exception, ThresholdError)
    assert CliRunner().invoke(compare, [*pair, "--max-rmse", "0.3"]).exit_code == 0


def test_json_is_all_that_is_printed(pair, tmp_path):
    result = CliRunner().invoke(compare, [*pair, "--json", "--no-flip", "--heat", str(tmp_path / "h.png")])
    data = json.loads(result.stdout)
    assert data["layers"][0]["rmse"] == 0.25
    assert data["layers"][0]["flip"] is None
    assert data["heat_scale"] == 0.25


def test_heat_states_its_scale(pair, tmp_path):
    result = CliRunner().invoke(compare, [*pair, "--heat", str(tmp_path / "h.png")])
    assert result.stdout.splitlines()[-1].startswith(
        f"{tmp_path / 'h.png'}: beauty, black is 0, pale yellow is 0.25"
    )


def test_contradictions_and_missing_files_are_input_errors(pair):
    assert CliRunner().invoke(compare, [*pair, "--no-flip", "--max-flip", "0.1"]).exit_code == 2
    result = CliRunner().invoke(compare, [pair[0], "missing.exr"])
    assert isinstance(result.exception, InputError)


def test_help_shows_examples():
    text = CliRunner().invoke(compare, ["--help"]).stdout
    assert "illum compare reference.exr new.exr --layer beauty --max-rmse 0.001" in text
