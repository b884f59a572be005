"""Pictures in single precision against an independent renderer in double precision."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

spec = importlib.util.spec_from_file_location("float64_reference", Path(__file__).with_name("float64.py"))
reference = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = reference
spec.loader.exec_module(reference)


OFTEN = ("metal", "far")
SETUPS = [
    pytest.param(setup, id=setup.name, marks=[] if setup.name in OFTEN else pytest.mark.slow)
    for setup in reference.setups()
]


@pytest.mark.parametrize("setup", SETUPS)
def test_single_precision_follows_double(setup, tmp_path):
    rows, counts = reference.compare(setup, tmp_path)
    assert counts["seen"] > 200
    assert counts["other triangle"] + counts["other shadow"] + counts["other obscurance ray"] <= 3, counts
    for row in rows:
        assert row.largest <= 1e-5, row
        assert row.rms <= 1e-6, row
    layers = {row.layer: row for row in rows}
    assert {"beauty", "diffuse", "specular", "ambient", "obscurance", "Z", "P", "N", "Ng"} <= set(layers)
