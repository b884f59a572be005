"""The report of a bake."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from illumcli import __version__
from illumcli.baking.context import SampleStatistics
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
    sampled: Mapping[str, SampleStatistics]  # of each value that rays estimate, by its channel
    textures: list[dict[str, Any]]  # `TexturePoints.as_data` of each
    sampled_texels: Mapping[str, SampleStatistics]
    ray_loop: str | None  # how rays were traced, if any were
    repairs: Repairs
    left_out: list[str]
    warnings: list[str]
    seconds: Mapping[str, float]  # by stage
    written: list[str]
    kept: list[str]

    def as_data(self) -> dict[str, Any]:
        """The report as JSON holds it."""
        sampled, at_texels = (
            {name: vars(each) for name, each in of.items()} for of in (self.sampled, self.sampled_texels)
        )
        data = vars(self) | {"sampled": sampled, "sampled_texels": at_texels} | repairs_data(self.repairs)
        return {"illum": __version__, **data, "peak_memory_bytes": peak_memory()}

    def summary(self) -> str:
        """A line for vertices, and one for texels: the errors of the values, and what they took."""
        texels = sum(each["texels"] for each in self.textures)
        lines = [
            f"{count} {of}: " + "; ".join(f"{name} {each.summary()}" for name, each in sampled.items())
            for count, of, sampled in (
                (self.vertices, "vertices", self.sampled),
                (texels, "texels", self.sampled_texels),
            )
            if sampled
        ]
        return "\n".join(lines)
