"""Views of BRDFs on one sheet: a row per view, a column per model or curves of all on one axis."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from illumcli.brdf.curves import draw_curves, legend, panels
from illumcli.brdf.files import figure_bytes
from illumcli.brdf.pictures import draw_pictures
from illumcli.brdf.plot import COLUMN, CURVES, Plot
from illumcli.brdf.style import SETTINGS, Style
from illumcli.brdf.views import Look
from illumcli.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHAPES = {"polar": 0.66, **dict.fromkeys(CURVES[1:], 0.62), "sphere": 0.77, "plane": 0.48, "lobe": 0.74}
"""Height of an axis, relative to the width."""
LEGEND_LINE = 0.17
"""Height of a line of the legend [inches]."""
PROJECTIONS = {"polar": "polar", "lobe": "3d"}


def figure_file(models: Mapping[str, Look], plot: Plot, kind: str) -> bytes:
    """The picture as a PNG, SVG or PDF file.

    Parameters
    ----------
    models : mapping
        By their titles.
    kind : {'png', 'svg', 'pdf'}

    Raises
    ------
    InputError
        matplotlib is not installed, or a title has a faulty formula.
    """
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError(
            "pictures of BRDFs need matplotlib; install it: pip install 'illumcli[plot]', or write --csv"
        ) from None
    for title in models:
        _refuse_faulty_math(title)
    width = plot.inches(len(models))
    rows = _rows(plot, len(models), width)
    heights = [SHAPES[row[0]] * width / len(row) for row in rows]
    with rc_context(SETTINGS):
        figure = Figure(dpi=150, layout="constrained")
        grid = figure.add_gridspec(len(rows), 1, height_ratios=heights)
        named: dict[str, Style] = {}
        has_titles = False
        for number, row in enumerate(rows):
            inner = grid[number, 0].subgridspec(1, len(row))
            axes = [
                figure.add_subplot(inner[k], projection=PROJECTIONS.get(view)) for k, view in enumerate(row)
            ]
            named |= _draw_row(axes, row, models, plot)
            if not plot.shares_axis(row[0]) and not has_titles:
                has_titles = True
                for one, title in zip(axes, models, strict=True):
                    one.set_title(title)
        lines = _draw_legend(figure, named, width)
        figure.set_size_inches(width, sum(heights) + LEGEND_LINE * lines)
        return figure_bytes(figure, kind)


def _refuse_faulty_math(label: str) -> None:
    """Raise InputError for a label whose formula between dollar signs cannot be read."""
    from matplotlib.mathtext import MathTextParser

    try:
        MathTextParser("path").parse(label)
    except ValueError:
        fact = "is no formula that matplotlib reads"
        raise InputError(f"--label '{label}': {fact}; correct it, or write \\$ for a dollar sign") from None


def _rows(plot: Plot, models: int, width: float) -> list[list[str]]:
    """The views of the axes of each row: a view of every model, or views of all models side by side."""
    beside = max(1, round(width / COLUMN))
    shared = [view for view in plot.views if plot.shares_axis(view)]
    rows = [shared[k : k + beside] for k in range(0, len(shared), beside)]
    return rows + [[view] * models for view in plot.views if not plot.shares_axis(view)]


def _draw_row(
    axes: Sequence[Any], row: Sequence[str], models: Mapping[str, Look], plot: Plot
) -> dict[str, Style]:
    """Draw the axes of a row; the styles of its curves by name."""
    if row[0] not in CURVES:
        draw_pictures(row[0], axes, list(models.values()), plot)
        return {}
    named: dict[str, Style] = {}
    apart = [([one], view) for one, view in zip(axes, row, strict=True)]
    for group, view in apart if plot.overlay else [(axes, row[0])]:
        drawn = panels(view, list(models.items()), plot)
        draw_curves(view, group, drawn, plot)
        named |= legend(drawn)
    return named


def _draw_legend(figure: Figure, named: Mapping[str, Style], width: float) -> int:
    """Draw the names of curves above the axes, in as many columns as fit. Returns the number of lines."""
    from matplotlib.lines import Line2D

    if not named:
        return 0
    longest = max(len(re.sub(r"\\[a-z]+|[${}]", "", name)) for name in named)
    columns = max(1, min(len(named), int(width / (0.5 + 0.06 * longest))))
    figure.legend(
        handles=[Line2D([], [], label=name, **each.line()) for name, each in named.items()],
        loc="outside upper center",
        ncols=columns,
        frameon=False,
        handlelength=2.4,
        columnspacing=1.2,
    )
    return -(-len(named) // columns)
