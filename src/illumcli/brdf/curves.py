"""Views that are curves: polar and Cartesian slices, slices across, albedo; on one axis or on several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from illumcli.brdf import views
from illumcli.brdf.albedo import TOLERANCE, albedo_curve
from illumcli.brdf.plot import Plot
from illumcli.brdf.scales import DECADES, STEEPEST, radius, scale
from illumcli.brdf.style import Style, style
from illumcli.brdf.views import Doubles, Look
from illumcli.color import luminance

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes


class Curve(NamedTuple):
    """One line of an axis."""

    x: Doubles
    """(K,) angles [degrees]."""
    y: Doubles
    """(K,)"""
    style: Style
    name: str
    """What the legend says of it; empty if it says nothing."""
    incidence: float | None
    """Angle of its light [degrees]."""


class Panel(NamedTuple):
    """The curves of one axis."""

    curves: list[Curve]
    note: str
    """What is to be said about their accuracy."""


def panels(view: str, titled: Sequence[tuple[str, Look]], plot: Plot) -> list[Panel]:
    """The axes of a view: one for each model, or one for all.

    Parameters
    ----------
    titled : sequence
        Title and model.
    """
    found: list[Panel] = []
    for place, (title, model) in enumerate(titled):
        panel = _panel(view, model, plot, (place, title) if plot.overlay else (0, ""))
        if plot.overlay and found:
            found[0].curves.extend(panel.curves)
            found[0] = found[0]._replace(note=found[0].note or panel.note)
        else:
            found.append(panel)
    return found


def _panel(view: str, model: Look, plot: Plot, series: tuple[int, str]) -> Panel:
    """The curves of one model; `series` is the number and name by which an overlay tells it apart."""
    if view == "albedo":
        angles, values, error = albedo_curve(model)
        note = f"albedo to {100 * error:.1g} %" if error > TOLERANCE else ""
        return Panel(_channels((angles, values), plot, series, None), note)
    look = views.across_slice if view == "across" else views.polar_slice
    curves: list[Curve] = []
    for number, incidence in enumerate(plot.angles):
        name = series if plot.overlay or plot.per_channel else (number, rf"$\theta_i$ = {incidence:g}°")
        curves += _channels(look(model, incidence, plot.times_cos), plot, name, incidence)
    return Panel(curves, "")


def _channels(
    data: tuple[Doubles, Doubles], plot: Plot, series: tuple[int, str], incidence: float | None
) -> list[Curve]:
    """The luminance of (K, 3) values over angles, or each channel."""
    (angles, values), (number, name) = data, series
    if not plot.per_channel:
        return [Curve(angles, luminance(values), style(number), name, incidence)]
    return [
        Curve(angles, values[:, c], style(3 * number + c, c), f"{name} {'RGB'[c]}".strip(), incidence)
        for c in range(3)
    ]


def legend(panels: Sequence[Panel]) -> dict[str, Style]:
    """The styles by name, over all axes."""
    return {curve.name: curve.style for panel in panels for curve in panel.curves if curve.name}


def draw_curves(view: str, axes: Sequence[Any], panels: Sequence[Panel], plot: Plot) -> None:
    """Draw the axes of a view, on one scale; `axes` are polar ones for `polar`."""
    visible = [
        curve.y[(np.abs(curve.x) < STEEPEST) | (view == "albedo")] for each in panels for curve in each.curves
    ]
    top = scale(visible, plot.log and view != "albedo")
    for one, panel in zip(axes, panels, strict=True):
        DRAW[view](one, panel.curves, plot, top)
        if panel.note:
            one.text(0.02, 0.02, panel.note, transform=one.transAxes, fontsize=6)
    if view != "polar":
        axes[0].set_ylabel("albedo" if view == "albedo" else quantity(plot))


def quantity(plot: Plot) -> str:
    """What slices and lobes show."""
    return "response, cosine included" if plot.times_cos else "BRDF [1/sr]"


def _draw_polar(axes: PolarAxes, curves: Sequence[Curve], plot: Plot, top: float) -> None:
    """Slices in the upper half circle, the normal upwards; the value `top` is at the rim."""
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_thetamin(-90)
    axes.set_thetamax(90)
    for curve in curves:
        axes.plot(np.radians(curve.x), radius(curve.y, top, plot.log), **curve.style.line())
    for incidence, color in _lights(curves, plot).items():
        axes.plot([np.radians(incidence)] * 2, [0, 1], ":", color=color, linewidth=0.6)
        axes.plot([np.radians(-incidence)] * 2, [0.93, 1.0], color=color, linewidth=2.5)
    axes.set_rmax(1.0)
    if plot.log:
        steps = np.arange(1, DECADES + 1)
        power = round(np.log10(top)) - DECADES
        axes.set_yticks(steps / DECADES, [f"$10^{{{power + k}}}$" for k in steps])
    else:
        axes.set_yticks([0.5, 1.0], [f"{top / 2:.3g}", f"{top:.3g}"])
    axes.tick_params(pad=1)
    axes.set_xticks(np.radians([-90, -60, -30, 0, 30, 60, 90]))
    axes.grid(True)
    axes.set_xlabel(quantity(plot), labelpad=-18)


def _draw_slices(axes: Any, curves: Sequence[Curve], plot: Plot, top: float) -> None:
    """Slices over the angle of view."""
    _draw_lines(axes, curves, plot, top)
    for incidence, color in _lights(curves, plot).items():
        axes.axvline(incidence, linestyle=":", color=color, linewidth=0.6)
        axes.axvline(-incidence, 0.95, 1.0, color=color, linewidth=2.5)
    axes.set_xlabel("angle of view [°]")


def _draw_across(axes: Any, curves: Sequence[Curve], plot: Plot, top: float) -> None:
    """Slices over the angle from the mirror direction."""
    _draw_lines(axes, curves, plot, top)
    axes.set_xlabel("angle from the mirror direction, across [°]")


def _draw_lines(axes: Any, curves: Sequence[Curve], plot: Plot, top: float) -> None:
    for curve in curves:
        axes.plot(curve.x, curve.y, **curve.style.line())
    axes.set_xlim(-90, 90)
    axes.set_xticks([-90, -60, -30, 0, 30, 60, 90])
    if plot.log:
        axes.set_yscale("log")
        axes.set_ylim(top * 10.0**-DECADES, top)
    else:
        axes.set_ylim(0, top)
    axes.grid(True)


def _draw_albedo(axes: Any, curves: Sequence[Curve], plot: Plot, top: float) -> None:
    """Albedo over the angle of incidence; above 1 the model reflects more than there is."""
    for curve in curves:
        axes.plot(curve.x, curve.y, **curve.style.line())
    if top > 1:
        axes.axhline(1, color="0.5", linewidth=0.6)
    axes.set_xlim(0, 90)
    axes.set_xticks([0, 15, 30, 45, 60, 75, 90])
    axes.set_ylim(0, top)
    axes.set_xlabel("angle of incidence [°]")
    axes.grid(True)


def _lights(curves: Sequence[Curve], plot: Plot) -> dict[float, str]:
    """Angle of incidence -> the colour of its marks: that of its curve if it has one of its own."""
    grey = plot.overlay or plot.per_channel
    return {
        curve.incidence: "0.5" if grey else curve.style.color
        for curve in curves
        if curve.incidence is not None
    }


DRAW = {"polar": _draw_polar, "cartesian": _draw_slices, "across": _draw_across, "albedo": _draw_albedo}
"""View -> the function that draws an axis of it."""
