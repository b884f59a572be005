"""Views of BRDFs drawn by matplotlib: a column per model, a row per view, scales shared along a row."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from illumcli.brdf import views
from illumcli.color import luminance, to_srgb
from illumcli.errors import InputError
from illumcli.models._base import IlluminationModel

DECADES = 4
"""How far below the largest value a logarithmic picture goes."""
STEEPEST = 85.0
"""Angles of view beyond do not set the scale: there some models grow without bound [degrees]."""


def drawn(
    models: Mapping[str, IlluminationModel],
    chosen: Sequence[str],
    angles: Sequence[float],
    log: bool,
    times_cos: bool,
    kind: str,
) -> bytes:
    """The picture as a PNG or SVG file.

    Parameters
    ----------
    models : mapping
        By the title of their column.
    chosen : sequence of {'polar', 'sphere', 'plane', 'lobe'}
    angles : sequence of float
        Angles of incidence of the polar slices [degrees]; the lobe is that of the middle one.
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
    height = {"polar": 2.1, "sphere": 2.4, "plane": 1.5, "lobe": 2.3}
    tall = [height[view] for view in chosen]
    columns = len(models)
    with rc_context({"svg.hashsalt": "illum", "font.size": 8, "path.simplify": True}):
        figure = Figure(figsize=(3.1 * columns, sum(tall) + 0.45), dpi=150, layout="constrained")
        grid = figure.add_gridspec(len(chosen), columns, height_ratios=tall)
        for row, view in enumerate(chosen):
            made = _ROWS[view](list(models.values()), angles, log, times_cos)
            for column, (title, draw) in enumerate(zip(models, made, strict=True)):
                axes = figure.add_subplot(grid[row, column], projection=_PROJECTIONS.get(view))
                draw(axes)
                if row == 0:
                    axes.set_title(title, fontsize=9)
        figure.supxlabel(_caption(chosen, angles, log, times_cos), fontsize=7)
        file = io.BytesIO()
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(file, format=kind, metadata=metadata)
    return file.getvalue()


_PROJECTIONS = {"polar": "polar", "lobe": "3d"}


def _caption(chosen: Sequence[str], angles: Sequence[float], log: bool, times_cos: bool) -> str:
    quantity = "response, the cosine included" if times_cos else "response / n.l [1/sr]"
    shown = f"{quantity}, luminance{', logarithmic' if log else ''}"
    parts = []
    if "polar" in chosen:
        parts.append(f"polar: {shown}; lights marked on the left rim, their mirror directions dotted")
    if "lobe" in chosen:
        parts.append(f"lobe: {shown}, light at {_middle(angles):g}°, red")
    return "\n".join(parts)


def _middle(angles: Sequence[float]) -> float:
    return sorted(angles)[len(angles) // 2]


def _scaled(found: Any, top: float, log: bool) -> Any:
    """Values as radii, 1 at `top` and beyond; logarithmic ones are 0 at DECADES below."""
    share = np.minimum(found / top, 1)
    return np.maximum(1 + np.log10(np.maximum(share, 1e-300)) / DECADES, 0) if log else share


def _polar(
    models: Sequence[IlluminationModel], angles: Sequence[float], log: bool, times_cos: bool
) -> list[Any]:
    slices = [[views.polar_slice(model, angle, times_cos) for angle in angles] for model in models]
    top = _top([luminance(found[np.abs(at) < STEEPEST]) for each in slices for at, found in each])

    def panel(mine: Any) -> Any:
        def draw(axes: Any) -> None:
            from matplotlib import colormaps

            axes.set_theta_zero_location("N")
            axes.set_theta_direction(-1)
            axes.set_thetamin(-90)
            axes.set_thetamax(90)
            for k, (angle, (view, found)) in enumerate(zip(angles, mine, strict=True)):
                color = colormaps["viridis"](0.85 * k / max(len(angles) - 1, 1))
                radius = _scaled(luminance(found), top, log)
                axes.plot(np.radians(view), radius, color=color, linewidth=1.2)
                axes.plot([np.radians(angle)] * 2, [0, 1], ":", color=color, linewidth=0.6)
                axes.plot([np.radians(-angle)] * 2, [0.93, 1.0], color=color, linewidth=2.5)
            axes.set_rmax(1.0)
            _radial_ticks(axes, top, log)
            axes.set_xticks(np.radians([-90, -60, -30, 0, 30, 60, 90]))
            axes.grid(alpha=0.35, linewidth=0.4)

        return draw

    return [panel(mine) for mine in slices]


def _top(found: Sequence[Any]) -> float:
    """The largest value, rounded up to a number with few digits, above 0."""
    largest = max((float(each.max()) for each in found), default=0.0)
    if not largest > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(largest))
    return float(
        next(step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if step * power >= largest * (1 - 1e-12)) * power
    )


def _radial_ticks(axes: Any, top: float, log: bool) -> None:
    if log:
        steps = np.arange(1, DECADES + 1)
        axes.set_yticks(steps / DECADES, [f"{top * 10.0 ** (k - DECADES):.2g}" for k in steps])
    else:
        axes.set_yticks([0.5, 1.0], [f"{top / 2:.3g}", f"{top:.3g}"])
    axes.tick_params(labelsize=6, pad=1)


def _lobes(
    models: Sequence[IlluminationModel], angles: Sequence[float], log: bool, times_cos: bool
) -> list[Any]:
    incidence = _middle(angles)
    found = [views.lobe(model, incidence, times_cos) for model in models]
    seen = np.cos(np.radians(STEEPEST))
    top = _top([luminance(each[way[..., 2] > seen]) for way, each in found])
    angle = np.radians(incidence)

    def panel(directions: Any, color: Any) -> Any:
        def draw(axes: Any) -> None:
            radius = _scaled(luminance(color), top, log)
            x, y, z = np.moveaxis(directions * radius[..., None], -1, 0)
            axes.plot_surface(x, y, z, color="#e0b64a", rcount=61, ccount=61, linewidth=0, antialiased=False)
            axes.plot([0, -np.sin(angle)], [0, 0], [0, np.cos(angle)], color="crimson", linewidth=1.2)
            ring = np.linspace(0, 2 * np.pi, 97)
            axes.plot(np.cos(ring), np.sin(ring), 0 * ring, color="0.6", linewidth=0.5)
            axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(0, 1))
            axes.set_box_aspect((2, 2, 1), zoom=1.35)
            axes.view_init(elev=24, azim=-65)
            axes.set_axis_off()

        return draw

    return [panel(*each) for each in found]


def _pictures(shown: Any) -> Any:
    def row(
        models: Sequence[IlluminationModel], angles: Sequence[float], log: bool, times_cos: bool
    ) -> list[Any]:
        def panel(model: IlluminationModel) -> Any:
            def draw(axes: Any) -> None:
                picture = shown(model)
                alpha = picture[..., 3:]
                color = to_srgb(np.clip(picture[..., :3] / np.maximum(alpha, 1e-9), 0, 1))
                axes.imshow(np.concatenate([color, alpha], axis=-1), interpolation="antialiased")
                axes.set_axis_off()

            return draw

        return [panel(model) for model in models]

    return row


_ROWS = {
    "polar": _polar,
    "sphere": _pictures(views.lit_sphere),
    "plane": _pictures(views.lit_plane),
    "lobe": _lobes,
}
