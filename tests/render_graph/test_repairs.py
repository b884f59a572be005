from __future__ import annotations

import pytest

from illumcli.errors import InputError
from illumcli.geometry.repairs import APPROXIMATED, HARMLESS, Repair
from illumcli.render_graph.repairs import refuse_repairs, repair_lines


def test_harmless_classes_are_told_to_those_who_ask() -> None:
    found = {"faces": Repair(2, "a.obj:3"), "unused vertices": Repair(7)}
    assert "unused vertices" in HARMLESS
    assert repair_lines(found, verbose=False) == ["faces: 2, the first is a.obj:3"]
    assert repair_lines(found, verbose=True) == ["faces: 2, the first is a.obj:3", "unused vertices: 7"]


def test_what_no_file_is_to_blame_for_is_told_and_not_refused() -> None:
    found = {what: Repair(1) for what in APPROXIMATED}
    assert repair_lines(found, verbose=False) == [f"{what}: 1" for what in APPROXIMATED]
    refuse_repairs("a.yaml", found)
    with pytest.raises(InputError) as caught:
        refuse_repairs("a.yaml", {**found, "faces": Repair(2, "a.obj:3")})
    (problem,) = caught.value.problems
    assert problem.startswith("a.yaml: faces: 2, the first is a.obj:3; ")
