"""Units in the texts of fields."""

from __future__ import annotations

import pytest

from illumcli.schema.docs import unit_in


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("Vertical field of view [degrees].", "degrees"),
        ("[W/m^2] on a surface that faces the light.", "W/m^2"),
        ("Shares of `x` in [0, 1] and [a, b].", ""),
        ("A colour.", ""),
    ],
)
def test_the_unit_is_what_stands_in_brackets(text, unit):
    assert unit_in(text) == unit
