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
    """How adaptive sampling decides which pixels get all samples (`film.adaptive`)."""

    probes: int
    """Samples per pixel whose first hits are compared."""
    reach: int
    """Reach of the pixel filter from a pixel [pixels]."""
    spread: float
    """Variance of the pixel filter, as a multiple of a box's of one pixel."""


class View(Value):
    """One image: a camera, with the size and sampling of its film."""

    name: str
    camera: Camera
    width: int
    height: int
    samples: int
    adaptive: Adaptive | None = None
    """Not None if pixels get one sample or all."""
    stands_for: int = 1
    """Number of samples whose obscurance rays each sample casts."""

    @property
    def reach(self) -> int:
        """Reach of the pixel filter of an adaptive image [pixels]."""
        return self.adaptive.reach if self.adaptive else 0

    @property
    def border(self) -> int:
        """Width of the border around a tile that decides about the tile's pixels [pixels]."""
        return self.reach + 1

    def centres(self) -> View:
        """The adaptive view with one sample per pixel."""
        return replace(self, samples=1, stands_for=self.samples)

    def all_samples(self) -> View:
        """The view with all samples for every pixel."""
        return replace(self, adaptive=None)

    def probing(self) -> View:
        """The view with the samples whose first hits are compared."""
        assert self.adaptive is not None
        return replace(self, samples=self.adaptive.probes, adaptive=None, stands_for=1)


def samples(seed: int, view: View, tile: Tile) -> Samples:
    """Sample positions of the tile, keyed by pixel number."""
    x, y = tile.pixels()
    pixel = (y * view.width + x).astype(np.uint32)
    points = sampling.pixel_points(sampling.stream(seed, "pixel"), pixel, view.samples)
    return Samples(x, y, points, view.samples)


def rays(film_filter: PixelFilter, render_space: RenderSpace, view: View, samples: Samples) -> Rays:
    """A ray per sample; a single sample is at its pixel's centre, whatever the filter."""
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
    """(M,) distance from the plane through the eye, along the view direction, at least 0 [scene units]."""
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
