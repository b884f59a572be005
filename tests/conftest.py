"""What tests share: the folder of real meshes, where it is there."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MESHES = ROOT.parent / "shared" / "meshes"


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def real_mesh():
    """Path of a real mesh by file name; the test is skipped where the meshes are not at hand."""

    def find(name: str) -> Path:
        path = MESHES / name
        if not path.exists():
            pytest.skip(f"needs ../shared/meshes/{name}")
        return path

    return find
