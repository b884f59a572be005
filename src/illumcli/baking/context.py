"""What a method of baking takes, and what it returns."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors
from illumcli.baking.baked_texture import TextureUvs
from illumcli.baking.measures import Measure
from illumcli.baking.occluders import Occluders
from illumcli.baking.points import Surfaces
from illumcli.baking.settings import BakeSettings
from illumcli.baking.texel_points import Texels
from illumcli.baking.vertex_points import Vertices
from illumcli.files.journal import Journal
from illumcli.progress import Progress
from illumcli.records import Record
from illumcli.visibility.channels import Arrays


class StageClock:
    """Seconds of one stage after the other; a stage that comes again is added to."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Say that a stage is over."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now


class BakeContext(Record):
    """The surfaces of a bake, what occludes them, and what to sample."""

    surfaces: Surfaces
    occluders: Sequence[Occluders]  # per object
    measures: Sequence[Measure]
    settings: BakeSettings
    threads: int
    progress: Progress
    clock: StageClock
    journal: Journal


class SampleStatistics(Record):
    """What the values of a bake took. Errors have the unit of the values."""

    open: int  # points with no geometry on that side of their triangles: no rays
    cast: int  # points that cast rays
    rmse: float  # root mean square error over all points
    target: float | None  # the error that was asked for
    scale: float  # the largest value: 1, or the limit of thickness
    rays: Mapping[str, int]  # purpose -> rays
    resumed: int  # of these, rays that an earlier run cast
    samples: Mapping[int, int]  # rays per point -> points
    reconstruction: Mapping[str, Any] | None  # how values were reconstructed, and their audit

    def as_data(self) -> dict[str, Any]:
        """What files say of their values: the same whether or not the bake was interrupted."""
        rays = sum(self.rays.values())
        about = {"rmse": self.rmse, "scale": self.scale, "rays": rays}
        return {**about, "reconstruction": self.reconstruction}

    def summary(self) -> str:
        """The error of the values, and what they took."""
        how = "root mean square"
        if self.reconstruction is not None:
            audit = self.reconstruction["audit"]
            how += f", audited: {audit['low']:.2g} to {audit['high']:.2g}"
        rays = sum(self.rays.values())
        return f"error {self.rmse:.2g} ({how}), {rays} rays, {self.open} points open without a ray"


class SampledValues(Record):
    """Values of K points that are not open, and what they took."""

    w: NDArray[np.float32]  # (K,)
    error: NDArray[np.float32]  # (K,) standard error
    bent: Vectors | None  # (K, 3) float32 bent normals
    rmse: float  # root mean square error over all points, the open ones among them
    samples: NDArray[np.int64]  # (K,) rays of each
    rays: Mapping[str, int]  # purpose -> rays
    resumed: int  # of these, rays that an earlier run cast
    reconstruction: Mapping[str, Any] | None = None


class PointChannels(Record):
    """The channels of the settings at M points."""

    channels: Arrays  # (M,) or (M, 3) each
    statistics: Mapping[str, SampleStatistics]  # of each value that rays estimate, by its channel


class VertexChannels(Record):
    """Channels at the points of vertices."""

    vertices: Vertices
    of_points: PointChannels


class TexelChannels(Record):
    """Channels at the points of texels."""

    texels: Texels
    of_points: PointChannels
    unwrapped: Mapping[int, TextureUvs]  # object -> uv that were made for its textures


class BakedChannels(Record):
    """What was computed for the files of a bake that are due."""

    at_vertices: VertexChannels | None = None
    at_texels: TexelChannels | None = None

    @property
    def of_points(self) -> list[PointChannels]:
        """Of vertices and texels."""
        return [each.of_points for each in (self.at_vertices, self.at_texels) if each is not None]
