"""What is measured, and how."""

from __future__ import annotations

from typing import Any

from illumcli.records import Value


class SurfaceSource(Value):
    """Where a surface comes from."""

    text: str
    """A formula in x and y, or the name of a mesh or picture."""
    period: tuple[float, float] | None = None
    """Of a tile that is repeated along x and y; None for the default, 0, 0 for a single piece."""
    height: float | None = None
    """Of a picture: what white lies above black."""
    grid: int = 512
    """Of a formula: points along the longer period."""
    up: str = "z"
    """Axis of a mesh that points up."""
    footprint: float = 0.5
    """Of a single piece: the side of the footprint over that of its bounding rectangle."""


class MeasureSettings(Value):
    """Everything that measured values depend on, apart from the surface."""

    facets: str = "mirror"  # or `lambert`
    albedo: tuple[float, float, float] = (0.8, 0.8, 0.8)  # of Lambertian facets
    fresnel: str | None = None  # of mirrors: a name of `_fresnel.MATERIALS`, or an index; None reflects all
    bounces: int = 1
    isotropic: bool = True  # averaged by turning about the normal
    step: float = 10.0  # of the table that is not isotropic [degrees]
    resolution: float = 0.5  # half the width of the ring of normals that counts as h [degrees]
    samples: int = 64  # per cell
    target_error: float | None = None  # relative, of every row, instead of `samples`
    seed: int = 0

    def as_data(self) -> dict[str, Any]:
        """The settings for JSON."""
        return {**vars(self), "albedo": list(self.albedo)}
