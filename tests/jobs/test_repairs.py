from __future__ import annotations

from illumcli.geometry.repairs import HARMLESS, Repair
from illumcli.jobs.repairs import told


def test_harmless_classes_are_told_to_those_who_ask() -> None:
    found = {"faces": Repair(2, "a.obj:3"), "unused vertices": Repair(7)}
    assert "unused vertices" in HARMLESS
    assert told(found, verbose=False) == ["faces: 2, the first is a.obj:3"]
    assert told(found, verbose=True) == ["faces: 2, the first is a.obj:3", "unused vertices: 7"]
