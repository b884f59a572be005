"""Pages about models: every model, every parameter with its meaning."""

from __future__ import annotations

import pytest

from illumcli.commands.models import page, table
from illumcli.errors import InputError
from illumcli.schema.docs import field_docs
from illumcli.schema.families import members, tag_of
from illumcli.schema.sources import tags

MODELS = members("illumcli.models")


def test_the_table_has_every_model_with_parameters_and_claims():
    rows = {line.split()[0]: line for line in table().splitlines()}
    assert list(rows) == ["model", *tags("illumcli.models")]
    assert "sigma" in rows["oren_nayar"]
    assert "reciprocal" in rows["lambert"]
    assert "reciprocal" not in rows["phong"]


@pytest.mark.parametrize("Model", MODELS, ids=lambda Model: Model.__name__)
def test_a_page_has_formula_source_and_every_parameter(Model):
    text = page(tag_of(Model))
    assert "response = " in text
    assert "References" in text
    for name in Model.model_fields:
        assert name == "model" or f"\n{name}: " in text
        assert name == "model" or field_docs(Model)[name]


def test_a_page_goes_into_the_parts_of_a_parameter():
    text = page("cook_torrance")
    assert "m: number, 0.0001 to 10" in text
    assert "RMS slope" in text


def test_an_unknown_model_is_answered_with_the_nearest():
    with pytest.raises(InputError, match="no model 'phng'; did you mean 'phong'"):
        page("phng")
