"""Views of BRDFs drawn by matplotlib: a column per model, a row per view, scales shared along a row."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from illumcli.brdf import views
from illumcli.brdf.plot import Plot
from illumcli.brdf.views import Doubles
from illumcli.color import luminance, to_srgb
from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec
    from matplotlib.projections.polar import PolarAxes

DECADES = 4
"""Range of a logarithmic scale below the largest value."""
STEEPEST = 85.0
"""Larger angles of view do not count for the scale: some models grow without bound there [degrees]."""
HEIGHTS = {"polar": 2.1, "sphere": 2.4, "plane": 1.5, "lobe": 2.3}
"""Heights of the rows [inches]."""
PROJECTIONS = {"polar": "polar", "lobe": "3d"}

Models: TypeAlias = Sequence[IlluminationModel]
Slice: TypeAlias = tuple[Doubles, Doubles]
"""(K,) angles of view [degrees], and (K, 3) values."""


def figure_file(models: Mapping[str, IlluminationModel], plot: Plot, kind: str) -> bytes:
    """The picture as a PNG or SVG file.

    Parameters
    ----------
    models : mapping
        By the title of their column.
    kind : {'png', 'svg'}

    Raises
    ------
    InputError
        matplotlib is not installed.
    """
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError(
            "pictures of BRDFs need matplotlib; install it: pip install 'illumcli[plot]', or write --csv"
        ) from None
    heights = [HEIGHTS[view] for view in plot.views]
    with rc_context({"svg.hashsalt": "illum", "font.size": 8, "path.simplify": True}):
        figure = Figure(figsize=(3.1 * len(models), sum(heights) + 0.45), dpi=150, layout="constrained")
        grid = figure.add_gridspec(len(plot.views), len(models), height_ratios=heights)
        for row, view in enumerate(plot.views):
            row_axes = _row_axes(figure, grid, row, PROJECTIONS.get(view))
            ROWS[view](row_axes, list(models.values()), plot)
            if row == 0:
                for axes, title in zip(row_axes, models, strict=True):
                    axes.set_title(title, fontsize=9)
        figure.supxlabel(_caption(plot), fontsize=7)
        file = io.BytesIO()
        # Without date and version, so that equal drawings are equal files.
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(file, format=kind, metadata=metadata)
    return file.getvalue()


def _row_axes(figure: Figure, grid: GridSpec, row: int, projection: str | None) -> list[Axes]:
    """The axes of a row, one for each model."""
    return [figure.add_subplot(grid[row, column], projection=projection) for column in range(grid.ncols)]


def _caption(plot: Plot) -> str:
    quantity = "response, the cosine included" if plot.times_cos else "response / n.l [1/sr]"
    shown = f"{quantity}, luminance{', logarithmic' if plot.log else ''}"
    parts = []
    if "polar" in plot.views:
        parts.append(f"polar: {shown}; lights marked on the left rim, their mirror directions dotted")
    if "lobe" in plot.views:
        parts.append(f"lobe: {shown}, light at {plot.lobe_angle:g}°, red")
    return "\n".join(parts)


def _polar_row(row_axes: Sequence[Any], models: Models, plot: Plot) -> None:
    """Slices of every model, on one scale."""
    slices = [
        [views.polar_slice(model, incidence, plot.times_cos) for incidence in plot.angles] for model in models
    ]
    top = _scale([luminance(f[np.abs(angle) < STEEPEST]) for each in slices for angle, f in each])
    for axes, of_model in zip(row_axes, slices, strict=True):
        _draw_slices(axes, of_model, plot, top)


def _draw_slices(axes: PolarAxes, slices: Sequence[Slice], plot: Plot, top: float) -> None:
    """The slices of one model, with a colour for each angle of incidence; the value `top` is at the rim."""
    from matplotlib import colormaps

    # The upper half circle, the normal upwards.
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_thetamin(-90)
    axes.set_thetamax(90)

    # The slice, the mirror direction, and a mark at the light.
    for k, (incidence, (angle, f)) in enumerate(zip(plot.angles, slices, strict=True)):
        color = colormaps["viridis"](0.85 * k / max(len(plot.angles) - 1, 1))
        axes.plot(np.radians(angle), _radius(luminance(f), top, plot.log), color=color, linewidth=1.2)
        axes.plot([np.radians(incidence)] * 2, [0, 1], ":", color=color, linewidth=0.6)
        axes.plot([np.radians(-incidence)] * 2, [0.93, 1.0], color=color, linewidth=2.5)
    axes.set_rmax(1.0)
    _radial_ticks(axes, top, plot.log)
    axes.set_xticks(np.radians([-90, -60, -30, 0, 30, 60, 90]))
    axes.grid(alpha=0.35, linewidth=0.4)


def _radial_ticks(axes: PolarAxes, top: float, log: bool) -> None:
    if log:
        steps = np.arange(1, DECADES + 1)
        axes.set_yticks(steps / DECADES, [f"{top * 10.0 ** (k - DECADES):.2g}" for k in steps])
    else:
        axes.set_yticks([0.5, 1.0], [f"{top / 2:.3g}", f"{top:.3g}"])
    axes.tick_params(labelsize=6, pad=1)


def _lobe_row(row_axes: Sequence[Any], models: Models, plot: Plot) -> None:
    """The lobe of every model, on one scale."""
    lobes = [views.lobe(model, plot.lobe_angle, plot.times_cos) for model in models]
    is_visible = np.cos(np.radians(STEEPEST))
    top = _scale([luminance(f[v[..., 2] > is_visible]) for v, f in lobes])
    for axes, (v, f) in zip(row_axes, lobes, strict=True):
        _draw_lobe(axes, v * _radius(luminance(f), top, plot.log)[..., None], plot.lobe_angle)


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


def _sphere_row(row_axes: Sequence[Any], models: Models, plot: Plot) -> None:
    for axes, model in zip(row_axes, models, strict=True):
        _draw_picture(axes, views.lit_sphere(model))


def _plane_row(row_axes: Sequence[Any], models: Models, plot: Plot) -> None:
    for axes, model in zip(row_axes, models, strict=True):
        _draw_picture(axes, views.lit_plane(model))


def _draw_picture(axes: Axes, picture: Doubles) -> None:
    """A picture, (H, W, 4) linear R, G, B, premultiplied, and coverage."""
    alpha = picture[..., 3:]
    color = to_srgb(np.clip(picture[..., :3] / np.maximum(alpha, 1e-9), 0, 1))
    axes.imshow(np.concatenate([color, alpha], axis=-1), interpolation="antialiased")
    axes.set_axis_off()


def _scale(values: Sequence[Doubles]) -> float:
    """The largest of the values, rounded up to a number with few digits, above 0."""
    largest = max((float(each.max()) for each in values), default=0.0)
    if not largest > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(largest))
    return float(
        next(step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if step * power >= largest * (1 - 1e-12)) * power
    )


def _radius(values: Doubles, top: float, log: bool) -> Doubles:
    """Values as radii, 1 at `top` and beyond; on a logarithmic scale 0 at DECADES below."""
    share = np.minimum(values / top, 1)
    return np.maximum(1 + np.log10(np.maximum(share, 1e-300)) / DECADES, 0) if log else share


ROWS: dict[str, Callable[[Sequence[Any], Models, Plot], None]] = {
    "polar": _polar_row,
    "sphere": _sphere_row,
    "plane": _plane_row,
    "lobe": _lobe_row,
}
"""View -> the function that draws its row."""
