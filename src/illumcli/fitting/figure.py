"""Pictures of fits: slices of measurement and models, and spheres of both under one light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from illumcli.brdf import views
from illumcli.brdf.files import figure_bytes
from illumcli.color import luminance, to_srgb
from illumcli.errors import InputError
from illumcli.fitting.fit import Fit
from illumcli.fitting.measurement import STEEPEST, Measurement
from illumcli.fitting.responder import Responder
from illumcli.models._base import IlluminationModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

ANGLES = (10.0, 40.0, 65.0)
"""Angles of incidence of the slices [degrees]."""
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of the models; colour-blind safe (Okabe and Ito 2008)."""
STYLES = ("-", "--", "-.", ":")
DECADES = 4.5
"""Largest range of the value axis below its largest value."""


def figure_file(source: Path, fits: Mapping[str, Fit], measurement: Measurement, kind: str) -> bytes:
    """The picture as a PNG, SVG or PDF file.

    Parameters
    ----------
    source : Path
        The file of the measurement.
    fits : mapping
        By the name of the model.

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
            "pictures of fits need matplotlib; install it: pip install 'illumcli[plot]'"
        ) from None
    measured = _as_model(source)
    models = {name: fit.model for name, fit in fits.items()}
    with rc_context({"font.size": 8, "svg.hashsalt": "illum", "svg.fonttype": "none", "pdf.fonttype": 42}):
        figure = Figure(figsize=(7.2, 5.0), dpi=200, layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.15, 1))
        above, below = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
        if measured is None:
            _draw_pairs(above, measurement, models)
        else:
            _draw_slices(above, measured, models)
        spheres = models if measured is None else {"measured": measured, **models}
        _draw_spheres(below, spheres)
        return figure_bytes(figure, kind)


def _as_model(source: Path) -> IlluminationModel | None:
    """The model that looks a measurement up; None for pairs that none does."""
    suffix = source.suffix.lower()
    if suffix == ".npz" and source.with_suffix(".binary").is_file():
        source, suffix = source.with_suffix(".binary"), ".binary"
    match suffix:
        case ".binary":
            from illumcli.models.merl import Merl

            return Merl(file=str(source))
        case ".bsdf":
            from illumcli.models.rgl import Rgl

            return Rgl(file=str(source))
    return None


def _draw_slices(
    figure: SubFigure, measured: IlluminationModel, models: Mapping[str, IlluminationModel]
) -> None:
    """Slices in the plane of incidence, one for each angle."""
    row: Sequence[Axes] = figure.subplots(1, len(ANGLES), sharey=True)
    top, bottom = 0.0, np.inf
    for axes, incidence in zip(row, ANGLES, strict=True):
        angle, f = views.polar_slice(measured, incidence)
        seen = np.abs(angle) <= STEEPEST
        values = luminance(f)
        top = max(top, float(values[seen].max()))
        bottom = min(bottom, float(values[seen & (values > 0)].min(initial=np.inf)))
        axes.plot(angle[seen], values[seen], color="0.7", linewidth=3, label="measured")
        for number, (name, model) in enumerate(models.items()):
            angle, f = views.polar_slice(model, incidence)
            color, style = COLORS[number % len(COLORS)], STYLES[number % len(STYLES)]
            axes.plot(angle, luminance(f), style, color=color, linewidth=1.1, label=name)
        axes.axvline(-incidence, color="0.5", linewidth=0.6, linestyle=":")
        axes.set(title=f"light at −{incidence:g}°, dotted", xlabel="angle of view [degrees]", xlim=(-90, 90))
        axes.set_xticks([-90, -45, 0, 45, 90])
        axes.grid(alpha=0.3, linewidth=0.4)
    row[0].set_yscale("log")
    if top > 0:
        row[0].set_ylim(max(bottom / 3, top * 10.0**-DECADES), top * 2)
    row[0].set_ylabel("BRDF, luminance [1/sr]")
    row[0].legend(fontsize=7, frameon=False, loc="upper left")


def _draw_pairs(figure: SubFigure, measurement: Measurement, models: Mapping[str, IlluminationModel]) -> None:
    """The values of a table and of the models, against the angle of the half vector."""
    from matplotlib.ticker import LogLocator

    h = measurement.l + measurement.v
    theta_h = np.degrees(np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2]))
    pairs, cosine = Responder(measurement.l, measurement.v), measurement.l[:, 2:]
    row: Sequence[Axes] = figure.subplots(1, 2)
    left, right = row
    values = luminance(measurement.values)
    left.plot(theta_h, values, ".", color="0.6", markersize=3, label="measured")
    for number, (name, model) in enumerate(models.items()):
        fitted = luminance(pairs.response(model) / cosine)
        color = COLORS[number % len(COLORS)]
        left.plot(theta_h, fitted, ".", color=color, markersize=1.5, label=name)
        right.plot(values, fitted, ".", color=color, markersize=2)
    left.set(xlabel="angle of the half vector [degrees]", ylabel="BRDF, luminance [1/sr]", yscale="log")
    left.legend(fontsize=7, frameon=False)
    positive = values[values > 0]
    if positive.size:
        left.set_ylim(positive.min() / 1.5, positive.max() * 1.5)
        ends = float(positive.min()), float(positive.max())
        right.plot(ends, ends, color="0.3", linewidth=0.6)
        right.set(xscale="log", yscale="log")
    for axis in (left.yaxis, right.xaxis, right.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    right.set(xlabel="measured [1/sr]", ylabel="fitted [1/sr]")


def _draw_spheres(figure: SubFigure, models: Mapping[str, IlluminationModel]) -> None:
    """A lit sphere of each model, all with one exposure."""
    pictures = {name: views.lit_sphere(model) for name, model in models.items()}
    row: Sequence[Axes] = np.ravel(figure.subplots(1, len(pictures), squeeze=False)).tolist()
    for axes, (name, picture) in zip(row, pictures.items(), strict=True):
        alpha = picture[..., 3:]
        color = to_srgb(np.clip(picture[..., :3] / np.maximum(alpha, 1e-9), 0, 1))
        axes.imshow(np.concatenate([color, alpha], axis=-1), interpolation="antialiased")
        axes.set_title(name)
        axes.set_axis_off()
