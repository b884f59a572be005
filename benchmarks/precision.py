"""How far are pictures in single precision from the same scenes in double precision, layer by layer?

Reference: `tests/reference/float64.py`, a renderer of its own. Pixels whose every ray answered alike are
compared; the others, whose ray passes an edge by less than a rounding, are counted. Differences are over the
layer's largest value.
"""

from __future__ import annotations

import importlib.util
import platform
import sys
import tempfile
from pathlib import Path

import numpy as np

REFERENCE = Path(__file__).parents[1] / "tests" / "reference" / "float64.py"


def main() -> None:
    """Print a row per scene and layer."""
    spec = importlib.util.spec_from_file_location("float64_reference", REFERENCE)
    assert spec is not None
    assert spec.loader is not None
    reference = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = reference
    spec.loader.exec_module(reference)
    print(f"numpy {np.__version__}, Python {platform.python_version()}, {platform.machine()}\n")
    print(f"{'scene':8}{'layer':18}{'pixels':>7}{'largest':>10}{'RMS':>10}")
    for setup in reference.setups():
        with tempfile.TemporaryDirectory() as folder:
            rows, counts = reference.compare(setup, Path(folder))
        for row in rows:
            print(f"{setup.name:8}{row.layer:18}{row.pixels:7d}{row.largest:10.1e}{row.rms:10.1e}")
        print(f"{setup.name:8}{', '.join(f'{what}: {count}' for what, count in counts.items())}\n")


if __name__ == "__main__":
    main()
