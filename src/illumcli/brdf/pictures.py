"""Views that are pictures, one for each model: a lit sphere, a lit plane, the lobe in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from illumcli.brdf import views
from illumcli.brdf.curves import quantity
from illumcli.brdf.plot import Plot
from illumcli.brdf.scales import STEEPEST, radius, scale
from illumcli.brdf.views import Doubles, Look
from illumcli.color import luminance, to_srgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PIXELS = 160
"""Of a picture, for each inch of its column."""


def draw_pictures(view: str, axes: Sequence[Any], models: Sequence[Look], plot: Plot) -> None:
    """Draw a view of every model."""
    if view == "lobe":
        _draw_lobes(axes, models, plot)
        return
    look = views.lit_sphere if view == "sphere" else views.lit_plane
    size = 2 * round(PIXELS / 2 * plot.inches(len(models)) / len(models))
    for one, model in zip(axes, models, strict=True):
        _draw_picture(one, look(model, size))


def _draw_picture(axes: Axes, picture: Doubles) -> None:
    """A picture as `in_srgb` takes it."""
    axes.imshow(in_srgb(picture), interpolation="antialiased")
    axes.set_axis_off()


def in_srgb(picture: Doubles) -> Doubles:
    """(H, W, 4) sRGB and coverage, of a picture, (H, W, 4) linear R, G, B, premultiplied, and coverage."""
    alpha = picture[..., 3:]
    color = to_srgb(np.clip(picture[..., :3] / np.maximum(alpha, 1e-9), 0, 1))
    return np.concatenate([color, alpha], axis=-1)


def _draw_lobes(axes: Sequence[Any], models: Sequence[Look], plot: Plot) -> None:
    """The lobe of every model, on one scale."""
    lobes = [views.lobe(model, plot.lobe_angle, plot.times_cos) for model in models]
    is_visible = np.cos(np.radians(STEEPEST))
    top = scale([luminance(f[v[..., 2] > is_visible]) for v, f in lobes], plot.log)
    for one, (v, f) in zip(axes, lobes, strict=True):
        _draw_lobe(one, v * radius(luminance(f), top, plot.log)[..., None], plot.lobe_angle)
        shown = f"{quantity(plot)}, rim {top:.3g}" + (", logarithmic" if plot.log else "")
        one.set_title(f"{shown}; light at {plot.lobe_angle:g}°, red", fontsize=6, y=-0.05)


def _draw_lobe(axes: Any, surface: Doubles, incidence: float) -> None:
    """One lobe, (R, C, 3) points of its surface, with the light's direction and the horizon.

    `axes` is an Axes3D, for which matplotlib has no types.
    """
    x, y, z = np.moveaxis(surface, -1, 0)
    axes.plot_surface(x, y, z, color="#e0b64a", rcount=61, ccount=61, linewidth=0, antialiased=False)
    angle = np.radians(incidence)
    axes.plot([0, -np.sin(angle)], [0, 0], [0, np.cos(angle)], color="crimson", linewidth=1.2)
    ring = np.linspace(0, 2 * np.pi, 97)
    axes.plot(np.cos(ring), np.sin(ring), 0 * ring, color="0.6", linewidth=0.5)
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(0, 1))
    axes.set_box_aspect((2, 2, 1), zoom=1.35)
    axes.view_init(elev=24, azim=-65)
    axes.set_axis_off()
