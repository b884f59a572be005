"""``illum models`` as a user calls it."""

from __future__ import annotations

from click.testing import CliRunner

from illumcli.cli.models import models


def test_without_a_name_it_lists_the_models():
    result = CliRunner().invoke(models, [])
    assert result.exit_code == 0
    assert "lambert" in result.output


def test_with_a_name_it_prints_the_page():
    result = CliRunner().invoke(models, ["ward"])
    assert result.exit_code == 0
    assert "alpha_x: number, 0.0001 to 10" in result.output
