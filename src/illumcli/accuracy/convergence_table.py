"""A convergence measurement as a table, as CSV, and as a text plot."""

from __future__ import annotations

import math
from collections.abc import Sequence

from illumcli.accuracy.convergence import Convergence
from illumcli.accuracy.curves import Curve
from illumcli.accuracy.sampled import RECONSTRUCTED
from illumcli.files.reports import sealed_csv
from illumcli.tables import aligned
from illumcli.visibility.samplers import SAMPLERS

COLUMNS = (
    "scene", "camera", "layer", "width", "height", "vary", "sampler", "pixel_samples", "obscurance_rays",
    "count", "repeat", "seed", "content", "rays", "seconds", "rmse", "reference_rmse",
)  # fmt: skip


def convergence_table(result: Convergence) -> str:
    """A row per sampler and sampling, and the slopes below."""
    # A line per sampling; if random sampling was measured, with the samples that it would need.
    with_random = "random" in {curve.sampler for curve in result.curves}
    titles = (
        "sampler",
        "samples",
        "rays each",
        "rays",
        "seconds",
        "RMSE",
        "+-",
        *(("random needs",) * with_random),
    )
    rows = [titles]
    for curve in result.curves:
        for p in curve.points:
            row = (
                curve.sampler, str(p.pixel), str(p.obscurance), str(p.rays), f"{p.seconds:.3f}",
                f"{p.rmse:.5f}", "-" if math.isnan(p.spread) else f"{p.spread:.5f}",
            )  # fmt: skip
            rows.append((*row, _times(advantage(result, p.count, p.rmse))) if with_random else row)
    lines = aligned(rows, right=range(len(titles)))

    # The measurement and its reference.
    reference, half = result.reference, result.reference.sampling
    lines.append(
        f"{result.scene}: {result.layer} of {result.camera}, {result.width} x {result.height}, "
        f"{result.threads} threads, {result.repeats} repeats"
    )
    lines.append(
        f"reference: 2 x {half.pixel} samples of {half.obscurance} rays, RMSE {reference.rmse:.2g}, "
        "which is subtracted" + (", from the cache" if reference.reused else "")
    )
    lines += [
        f"slope {curve.sampler}: {curve.slope:.3f} +- {curve.slope_error:.3f}" for curve in result.curves
    ]
    return "\n".join(lines)


def advantage(result: Convergence, count: int, rmse: float) -> float:
    """Factor by which random sampling needs more samples for this error, from its fitted line."""
    random = [curve for curve in result.curves if curve.sampler == "random"]
    return random[0].count_for(rmse) / count if random else math.nan


def _times(factor: float) -> str:
    return f"{factor:.2f} x" if math.isfinite(factor) else "-"


def convergence_csv(result: Convergence) -> str:
    """A line per image."""
    rows = [
        (
            result.scene, result.camera, result.layer, result.width, result.height, result.vary,
            curve.sampler, p.pixel, p.obscurance, p.count, run.repeat, run.seed, run.content, run.rays,
            f"{run.seconds:.6f}", f"{run.rmse:.9g}", f"{result.reference.rmse:.9g}",
        )
        for curve in result.curves
        for p in curve.points
        for run in p.runs
    ]  # fmt: skip
    return sealed_csv(COLUMNS, rows)


def _mark(curve: Curve) -> str:
    """The character that marks a curve."""
    return "*" if curve.sampler.endswith(RECONSTRUCTED) else SAMPLERS[curve.sampler].mark


def text_plot(curves: Sequence[Curve], width: int = 64, height: int = 16) -> str:
    """Error over samples, drawn with characters on logarithmic axes."""
    # The markers, and the range of each axis.
    dots = [
        (math.log2(p.count), math.log2(p.rmse), _mark(curve))
        for curve in curves
        for p in curve.points
        if p.rmse > 0
    ]
    if not dots:
        return "no error to draw"
    (left, *_, right), (low, *_, high) = (
        sorted([*values, values[0]]) for values in list(zip(*dots, strict=True))[:2]
    )

    # Put the markers into a field of characters.
    field = [[" "] * width for _ in range(height)]
    for x, y, mark in dots:
        column = round((x - left) / ((right - left) or 1) * (width - 1))
        row = round((high - y) / ((high - low) or 1) * (height - 1))
        field[row][column] = mark

    # Add axes and legend.
    edges = {0: f"{2**high:.2g}", height - 1: f"{2**low:.2g}"}
    lines = [f"{edges.get(k, ''):>8} |{''.join(line).rstrip()}" for k, line in enumerate(field)]
    ends = f"{2**left:.0f}".ljust(width - 8) + f"{2**right:.0f}".rjust(8)
    legend = "   ".join(f"{_mark(curve)} {curve.sampler}" for curve in curves)
    return "\n".join([*lines, f"{'RMSE':>8} +{'-' * width}", f"{'':8}  {ends}", f"{'':8}  {legend}"])
