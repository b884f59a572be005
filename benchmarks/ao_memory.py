"""What does a bake of millions of triangles take?

Question   Peak memory and time of a bake against the number of triangles, at RAYS rays a vertex.
Mesh       A wavy sheet in binary PLY, made here; every bake is a process of its own.

    python benchmarks/ao_memory.py [MILLIONS...]
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

RAYS = 16


def sheet(path: Path, side: int) -> None:
    """2 (side - 1)^2 triangles over side^2 vertices."""
    x, y = np.meshgrid(np.linspace(-1, 1, side, dtype="<f4"), np.linspace(-1, 1, side, dtype="<f4"))
    z = 0.1 * np.sin(23 * x) * np.cos(19 * y)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype("<f4")
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    corners = np.concatenate(
        [np.stack([a, a + 1, a + side], axis=1), np.stack([a + 1, a + side + 1, a + side], axis=1)]
    )
    faces = np.empty(len(corners), [("count", "u1"), ("corner", "<i4", (3,))])
    faces["count"], faces["corner"] = 3, corners
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())


def main() -> None:
    print("triangles  vertices   seconds  us a vertex  peak MiB  bytes a triangle")
    for millions in [float(text) for text in sys.argv[1:]] or [1.25, 2.5, 5.0]:
        with tempfile.TemporaryDirectory() as folder:
            mesh, out, report = (Path(folder) / name for name in ("sheet.ply", "out.npz", "report.json"))
            sheet(mesh, round((millions * 5e5) ** 0.5) + 1)
            command = [sys.executable, "-m", "illumcli", "ao-bake", mesh, "-o", out, "--report", report, "-q"]
            subprocess.run([*command, "--samples", str(RAYS)], check=True, stdout=subprocess.DEVNULL)
            said = json.loads(report.read_text())
            seconds, peak = sum(said["seconds"].values()), said["peak_memory_bytes"]
            laps = ", ".join(f"{name} {lap:.1f}" for name, lap in said["seconds"].items())
            print(
                f"{said['triangles']:9d} {said['vertices']:9d} {seconds:9.1f} "
                f"{1e6 * seconds / said['vertices']:12.1f} {peak / 2**20:9.0f} "
                f"{peak / said['triangles']:17.0f}   ({laps})",
                flush=True,
            )


if __name__ == "__main__":
    main()
