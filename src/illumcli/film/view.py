"""A view, the rays through its samples, and distances along them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from illumcli.arrays import F, Floats, Vectors, dot, length
from illumcli.film.tiles import Samples, Tile
from illumcli.lights._base import towards
from illumcli.lights._incident import Placed
from illumcli.rays import sampling
from illumcli.rays.camera import Rays, axes, camera_rays, film_points
from illumcli.rays.interaction import SurfaceInteraction
from illumcli.rays.viewpoints import Camera, PixelFilter
from illumcli.records import Value
from illumcli.render_space import RenderSpace


class Adaptive(Value):
    """How the pixels are found that one sample is not enough for (`film.adaptive`)."""

    probes: int
    """Samples whose first hits are looked at."""
    reach: int
    """Pixels across and down that the pixel filter reaches from a pixel."""
    spread: float
    """Variance of the pixel filter, as a multiple of a box's of one pixel."""


class View(Value):
    """One picture: a camera and the size and sampling of its film."""

    name: str
    camera: Camera
    width: int
    height: int
    samples: int
    adaptive: Adaptive | None = None
    """Set where pixels get one sample or all."""
    stands_for: int = 1
    """Samples that each sample stands for: it casts the obscurance rays of so many."""

    @property
    def reach(self) -> int:
        """Pixels across and down that the pixel filter of an adaptive picture reaches from a pixel."""
        return self.adaptive.reach if self.adaptive else 0

    @property
    def border(self) -> int:
        """Pixels around a tile of an adaptive picture that decide about those within."""
        return self.reach + 1

    def centres(self) -> View:
        """An adaptive view with the one sample that every pixel gets."""
        return replace(self, samples=1, stands_for=self.samples)

    def all_samples(self) -> View:
        """The view with all samples for every pixel."""
        return replace(self, adaptive=None)

    def probing(self) -> View:
        """The view with the samples whose first hits are looked at."""
        assert self.adaptive is not None
        return replace(self, samples=self.adaptive.probes, adaptive=None, stands_for=1)


def samples(seed: int, view: View, tile: Tile) -> Samples:
    """Where the tile's samples lie, keyed by pixel number."""
    x, y = tile.pixels()
    pixel = (y * view.width + x).astype(np.uint32)
    points = sampling.pixel_points(sampling.stream(seed, "pixel"), pixel, view.samples)
    return Samples(x, y, points, view.samples)


def rays(film_filter: PixelFilter, render_space: RenderSpace, view: View, samples: Samples) -> Rays:
    """A ray per sample; a single sample looks through its pixel's centre whatever the filter."""
    several = samples.per_pixel > 1
    points = film_points(samples.x, samples.y, samples.points, film_filter if several else None)
    return camera_rays(view.camera, render_space, view.width, view.height, points)


def view_vectors(view: View, render_space: RenderSpace, points: Placed) -> Vectors:
    """(E, 3) float32 unit vectors to the eye."""
    if view.camera.projection == "orthographic":
        backward = (-axes(view.camera)[2]).astype(F)
        return np.asfortranarray(np.broadcast_to(backward, points.position.shape))
    return towards(render_space.from_world(view.camera.position), points.position)[0]


def depth(view: View, render_space: RenderSpace, interaction: SurfaceInteraction) -> Floats:
    """(M,) distance from the eye's plane along the line of sight, at least 0 [scene units]."""
    forward = axes(view.camera)[2]
    eye = render_space.from_world(view.camera.position)
    along = np.maximum(dot(interaction.position - eye, forward[None, :]), 0)
    return (along * render_space.radius).astype(F)


def distance(view: View, render_space: RenderSpace, interaction: SurfaceInteraction) -> Floats:
    """(M,) float64 distance along the line of sight from the eye, or from its plane [scene units]."""
    away = interaction.position - render_space.from_world(view.camera.position)
    if view.camera.projection == "orthographic":
        return dot(away, axes(view.camera)[2][None, :]) * render_space.radius
    return length(away) * render_space.radius
