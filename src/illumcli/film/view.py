"""A view, the rays through its samples, and distances along them."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

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


class Adaptive(Protocol):
    """How few samples every pixel has at first, and what makes it need all."""

    @property
    def first(self) -> int: ...
    @property
    def difference(self) -> float: ...


class View(Value):
    """One picture: a camera and the size and sampling of its film."""

    name: str
    camera: Camera
    width: int
    height: int
    samples: int
    adaptive: Adaptive | None = None
    first: int | None = None
    """Number of the first sample, where these are part of a pixel's samples."""

    @property
    def is_adaptive(self) -> bool:
        """Are pixels sampled to different counts?"""
        return self.adaptive is not None and self.adaptive.first < self.samples

    def coarse(self) -> View:
        """The view with the samples that every pixel gets."""
        assert self.adaptive is not None
        return replace(self, samples=self.adaptive.first, adaptive=None, first=0)

    def rest(self) -> View:
        """The view with all the other samples."""
        assert self.adaptive is not None
        few = self.adaptive.first
        return replace(self, samples=self.samples - few, adaptive=None, first=few)


def samples(seed: int, view: View, tile: Tile) -> Samples:
    """Where the tile's samples lie, keyed by pixel number."""
    x, y = tile.pixels()
    pixel = (y * view.width + x).astype(np.uint32)
    points = sampling.pixel_points(sampling.stream(seed, "pixel"), pixel, view.samples, view.first)
    return Samples(x, y, points, view.samples, view.first)


def rays(film_filter: PixelFilter, render_space: RenderSpace, view: View, samples: Samples) -> Rays:
    """A ray per sample; a single sample looks through its pixel's centre whatever the filter."""
    several = samples.per_pixel > 1 or samples.first is not None
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
