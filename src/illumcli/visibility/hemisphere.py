"""Rays over the hemisphere: cosine-weighted directions, the frames they are turned by, and their origins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, dot, perpendicular, repeat_rows, take_rows
from illumcli.rays.interaction import SurfaceInteraction
from illumcli.rays.pattern_rays import PatternRays
from illumcli.records import Record
from illumcli.visibility.samplers import GRAZING, SAMPLERS, patterns

PACKET = 16
"""Rays that are traced together, at most. They take a quarter less time if they start at one place."""


class Hemispheres(Record):
    """The hemispheres of M points, and the origins of the rays over them: E for each point."""

    n: Vectors  # (M, 3) float32 unit shading normals, the axes
    origins: Vectors  # (M * E, 3) float32 off the surface [radii]; those of a point follow each other
    ng: Vectors | None = None
    """(M * E, 3) float32 unit normals of the triangles that the rays leave; None if they equal `n`."""
    known_open: NDArray[np.bool_] | None = None
    """(M,) True for points that are known to be open, which cast no rays; None: for no point."""
    origin_of_ray: NDArray[np.int32] | None = None
    """(N,) which of its point's origins each ray starts from; None if points have one origin each."""

    @property
    def origins_per_point(self) -> int:
        """E."""
        return len(self.origins) // max(len(self.n), 1)

    def take(self, points: NDArray[np.int64]) -> Hemispheres:
        """The hemispheres of these points, in this order."""
        each = self.origins_per_point
        origin = points if each == 1 else (points[:, None] * each + np.arange(each)).ravel()
        return Hemispheres(
            take_rows(self.n, points),
            take_rows(self.origins, origin),
            None if self.ng is None else take_rows(self.ng, origin),
            None if self.known_open is None else self.known_open.take(points),
            self.origin_of_ray,
        )

    def between(self, first: int, end: int) -> Hemispheres:
        """The hemispheres of points `first` to `end`, as views of these arrays."""
        each = self.origins_per_point
        points, origins = slice(first, end), slice(first * each, end * each)
        return Hemispheres(
            self.n[points],
            self.origins[origins],
            None if self.ng is None else self.ng[origins],
            None if self.known_open is None else self.known_open[points],
            self.origin_of_ray,
        )


def hemispheres(
    interaction: SurfaceInteraction,
    ray_origins: Vectors,
    known_open: NDArray[np.bool_] | None,
    obscurance_normals: Vectors | None = None,
) -> Hemispheres:
    """The hemispheres of hits, about `obscurance_normals`; without these, about the triangles' normals."""
    if obscurance_normals is None:
        return Hemispheres(interaction.ng, ray_origins, known_open=known_open)
    return Hemispheres(obscurance_normals, ray_origins, interaction.ng, known_open)


def packet_of_ray(sampler: str, samples: int) -> NDArray[np.int32]:
    """(samples,) number of the packet that each ray of a pattern is traced in."""
    compact = patterns(SAMPLERS[sampler], np.zeros((2, 1)), samples).compact
    packet = np.arange(samples, dtype=np.int32) // PACKET
    if compact is None:
        return packet
    out = np.empty_like(packet)
    out[compact.number] = packet
    return out


def sample_frames(n: Vectors, draws: NDArray[np.float64], sampler: str) -> NDArray[np.float32]:
    """(M, 3, 3) float32 rows tangent, bitangent, `n` of each point; some samplers turn them at random."""
    angle = 2 * np.pi * draws[0] if SAMPLERS[sampler].turned else np.zeros(len(n))
    return turned_frame(n, angle.astype(F))


def turned_frame(n: Vectors, angle: NDArray[np.float32]) -> NDArray[np.float32]:
    """(M, 3, 3) rows tangent, bitangent, normal; the tangent turned about `n` by `angle` [rad]."""
    t, u = perpendicular(n)
    c, s = np.cos(angle), np.sin(angle)
    frame = np.empty((len(n), 3, 3), F)
    for k in range(3):
        frame[:, 0, k] = c * t[k] + s * u[k]
        frame[:, 1, k] = c * u[k] - s * t[k]
        frame[:, 2, k] = n[:, k]
    return frame


def hemisphere_rays(over: Hemispheres, draws: NDArray[np.float64], samples: int, sampler: str) -> PatternRays:
    """`samples` rays of each point over its hemisphere; none points below the triangle that it leaves.

    Parameters
    ----------
    draws : (2, M) float64
        In [0, 1): rotation and phase of each point's pattern, or its scramble.
    """
    # Only the last rays of a pattern can point below a triangle: spirals are ordered from the axis outwards.
    first_mirrored = np.full(len(over.n), samples, np.int32)
    if over.ng is not None:
        each = over.origins_per_point
        axes = over.n if each == 1 else repeat_rows(over.n, each)
        cosine = dot(axes, over.ng).reshape(-1, each).min(axis=1, initial=1)
        first_mirrored -= SAMPLERS[sampler].max_below(cosine, samples)
    return PatternRays(
        patterns(SAMPLERS[sampler], draws, samples),
        sample_frames(over.n, draws, sampler),
        over.origins,
        np.zeros(samples, np.int32) if over.origin_of_ray is None else over.origin_of_ray,
        over.ng,
        first_mirrored,
        GRAZING,
    )
