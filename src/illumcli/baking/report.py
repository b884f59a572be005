"""The report of a bake."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from illumcli import __version__
from illumcli.geometry.repairs import Repairs
from illumcli.memory import peak_memory
from illumcli.records import Record
from illumcli.render_graph.repairs import repairs_data


class BakeReport(Record):
    """What a bake did, in the order in which JSON has it."""

    input: str
    content: str
    seed: int
    threads: int
    vertices: int
    triangles: int
    unreferenced: int  # vertices that no polygon uses
    without_normal: int  # vertices whose polygons all have area 0
    copies: int  # vertices and normals that share the value of another at the same place
    open: int  # points with no geometry above their tangent plane: no rays
    cast: int  # points that cast rays
    rmse: float  # root mean square error over all vertices
    target_error: float | None
    rays: Mapping[str, int]  # purpose -> rays
    ray_loop: str | None  # how rays were traced, if any were
    resumed: int  # of these, rays that an earlier run cast
    samples: Mapping[int, int]  # rays per point -> points
    reconstruction: Mapping[str, Any] | None  # windows, and the audit of `rmse`
    repairs: Repairs
    left_out: list[str]
    warnings: list[str]
    seconds: Mapping[str, float]  # by stage
    written: list[str]
    kept: list[str]

    def as_data(self) -> dict[str, Any]:
        """The report as JSON holds it."""
        data = vars(self) | repairs_data(self.repairs)
        return {"illum": __version__, **data, "peak_memory_bytes": peak_memory()}

    def summary(self) -> str:
        """One line: the error of the values, and what they took."""
        rays = sum(self.rays.values())
        how = "root mean square"
        if self.reconstruction is not None:
            audit = self.reconstruction["audit"]
            how += f", audited: {audit['low']:.2g} to {audit['high']:.2g}"
        return (
            f"{self.vertices} vertices: error {self.rmse:.2g} ({how}), {rays} rays, "
            f"{self.open} points open without a ray"
        )
