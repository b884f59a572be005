"""A tetrahedron with baked obscurance, for tests of pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def baked_object(folder: Path, illum: Callable[..., Any]) -> str:
    """A line of a scene's objects; the mesh and its values are written to the scene's folder."""
    (folder / "tetrahedron.obj").write_text(TETRAHEDRON)
    done = illum("ao-bake", "tetrahedron.obj", "-o", "tetrahedron.npz", "--samples", "8", cwd=folder)
    assert done.returncode == 0, done.stderr
    mesh = "{file: tetrahedron.obj, obscurance: tetrahedron.npz}"
    return f"  - {{mesh: {mesh}, transform: {{translate: [-1, 0, 0]}}}}\n"
