"""A process that makes uv: vertices and triangles on stdin, uv on stdout.

The library holds Python's lock for minutes and takes no interrupt. A process of its own can be ended.
"""

from __future__ import annotations

import io
import signal
import sys

import numpy as np
import xatlas


def main() -> None:
    """Read `vertices` (V, 3) float32, `triangles` (T, 3) uint32, and `resolution` and `padding` [texels];
    write `uvs` (U, 2), `corner_uvs` (T, 3), and the number of `charts`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends this one
    given = np.load(io.BytesIO(sys.stdin.buffer.read()))
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.fix_winding = True
    packing.rotate_charts = False  # it exchanges x and y: such charts are mirrored
    packing.resolution, packing.padding = int(given["resolution"]), int(given["padding"])
    atlas = xatlas.Atlas()
    atlas.add_mesh(given["vertices"], given["triangles"])
    atlas.generate(charts, packing)
    _, corner_uvs, uvs = atlas[0]
    out = io.BytesIO()
    np.savez(out, uvs=uvs, corner_uvs=corner_uvs, charts=atlas.chart_count)
    sys.stdout.buffer.write(out.getvalue())


if __name__ == "__main__":
    main()
