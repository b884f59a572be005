"""Text tables whose columns line up."""

from __future__ import annotations

from illumcli.tables import aligned


def test_columns_line_up_to_the_side_asked_for():
    rows = [("name", "rays"), ("a", "12345"), ("longer", "7")]
    assert aligned(rows) == ["name    rays", "a       12345", "longer  7"]
    assert aligned(rows, right=(1,)) == ["name     rays", "a       12345", "longer      7"]
