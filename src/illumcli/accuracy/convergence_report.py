"""What `converge` found as a table, lines of text, a drawing of characters, and a picture."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Sequence
from pathlib import Path

from illumcli.accuracy.convergence import Convergence, Curve
from illumcli.cache.fingerprint import digest
from illumcli.errors import InputError
from illumcli.files.atomic import write_bytes, write_text
from illumcli.files.outputs import is_kept, refresh, refuse_suffix, refuse_unwritable
from illumcli.files.reports import report_contents, sealed_csv
from illumcli.files.seal import BLANK, sealed_png, sealed_text
from illumcli.images.contents import image_contents

COLUMNS = (
    "scene", "camera", "layer", "width", "height", "vary", "sampler", "pixel_samples", "obscurance_rays",
    "count", "repeat", "seed", "content", "rays", "seconds", "rmse", "reference_rmse",
)  # fmt: skip
MARKS = {"spiral": "o", "owen": "x", "random": "."}


def as_table(found: Convergence) -> str:
    """A row per sampler and sampling, the slopes below."""
    ruled = "random" in {curve.sampler for curve in found.curves}
    titles = (
        "sampler",
        "samples",
        "rays each",
        "rays",
        "seconds",
        "RMSE",
        "+-",
        *(("random needs",) * ruled),
    )
    rows = [titles]
    for curve in found.curves:
        for p in curve.points:
            row = (
                curve.sampler, str(p.pixel), str(p.obscurance), str(p.rays), f"{p.seconds:.3f}",
                f"{p.rmse:.5f}", "-" if math.isnan(p.spread) else f"{p.spread:.5f}",
            )  # fmt: skip
            rows.append((*row, _times(advantage(found, p.count, p.rmse))) if ruled else row)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(map(str.rjust, row, widths)) for row in rows]
    reference, half = found.reference, found.reference.sampling
    lines.append(
        f"{found.scene}: {found.layer} of {found.camera}, {found.width} x {found.height}, "
        f"{found.threads} threads, {found.repeats} repeats"
    )
    lines.append(
        f"reference: 2 x {half.pixel} samples of {half.obscurance} rays, RMSE {reference.rmse:.2g}, taken off"
        + (", from the store" if reference.reused else "")
    )
    lines += [
        f"slope {curve.sampler}: {curve.slope:.3f} +- {curve.slope_error:.3f}" for curve in found.curves
    ]
    return "\n".join(lines)


def _slope(curve: Curve) -> str:
    if math.isnan(curve.slope):
        return "-"
    error = "" if math.isnan(curve.slope_error) else f" +- {curve.slope_error:.3f}"
    return f"{curve.slope:.3f}{error}"


def advantage(found: Convergence, count: int, rmse: float) -> float:
    """How many times as many samples plain random sampling takes for this error, by its fitted line."""
    scale = [curve for curve in found.curves if curve.sampler == "random"]
    return scale[0].count_for(rmse) / count if scale else math.nan


def _times(factor: float) -> str:
    return f"{factor:.2f} x" if math.isfinite(factor) else "-"


def as_csv(found: Convergence) -> str:
    """A line per picture."""
    rows = [
        (
            found.scene, found.camera, found.layer, found.width, found.height, found.vary, curve.sampler,
            p.pixel, p.obscurance, p.count, run.repeat, run.seed, run.content, run.rays,
            f"{run.seconds:.6f}", f"{run.rmse:.9g}", f"{found.reference.rmse:.9g}",
        )
        for curve in found.curves
        for p in curve.points
        for run in p.runs
    ]  # fmt: skip
    return sealed_csv(COLUMNS, rows)


def drawn(curves: Sequence[Curve], width: int = 64, height: int = 16) -> str:
    """Error over samples in characters, both in logarithms."""
    dots = [
        (math.log2(p.count), math.log2(p.rmse), MARKS[curve.sampler])
        for curve in curves
        for p in curve.points
        if p.rmse > 0
    ]
    if not dots:
        return "no error to draw"
    (left, *_, right), (low, *_, high) = (
        sorted([*values, values[0]]) for values in list(zip(*dots, strict=True))[:2]
    )
    field = [[" "] * width for _ in range(height)]
    for x, y, mark in dots:
        column = round((x - left) / ((right - left) or 1) * (width - 1))
        row = round((high - y) / ((high - low) or 1) * (height - 1))
        field[row][column] = mark
    edges = {0: f"{2**high:.2g}", height - 1: f"{2**low:.2g}"}
    lines = [f"{edges.get(k, ''):>8} |{''.join(line).rstrip()}" for k, line in enumerate(field)]
    ends = f"{2**left:.0f}".ljust(width - 8) + f"{2**right:.0f}".rjust(8)
    legend = "   ".join(f"{MARKS[curve.sampler]} {curve.sampler}" for curve in curves)
    return "\n".join([*lines, f"{'RMSE':>8} +{'-' * width}", f"{'':8}  {ends}", f"{'':8}  {legend}"])


class Outputs:
    """The files that a measurement is to be written to; those that hold it already are kept.

    Raises
    ------
    InputError
        A suffix that is not written; matplotlib is not installed.
    OutputError
        A file that cannot be written.
    """

    def __init__(self, table: Path | None, picture: Path | None, force: bool) -> None:
        self.kept: list[Path] = []
        self._table, self._picture, self._force = table, picture, force
        self._content = ""
        for path in (table, picture):
            if path is not None and not os.path.isfile(path):
                refuse_unwritable(path)
        if table is not None:
            refuse_suffix(table, "a table", ".csv")
        if picture is not None:
            refuse_suffix(picture, "a picture of curves", ".png", ".svg")
            try:
                import matplotlib.figure  # noqa: F401
            except ImportError:
                way = "install it: pip install 'illumcli[plot]', or use --csv"
                raise InputError(f"pictures of curves need matplotlib; {way}") from None

    def check(self, contents: Sequence[str]) -> None:
        """Look at all that stands against writing what is made from `contents`.

        Raises
        ------
        OutputError
            A different file is there and is not to be replaced; a file cannot be written.
        """
        self._content = digest(contents)
        if self._table is not None and is_kept(self._table, contents, report_contents, self._force):
            self.kept.append(self._table)
        if self._picture is not None and is_kept(
            self._picture, [self._content], figure_contents, self._force
        ):
            self.kept.append(self._picture)

    def write(self, found: Convergence) -> None:
        """Write what is not kept."""
        if self._table is not None and self._table not in self.kept:
            write_text(self._table, as_csv(found))
        if self._picture is not None and self._picture not in self.kept:
            write_picture(self._picture, found, self._content)
        for path in self.kept:
            refresh(path)


def figure_contents(path: Path) -> list[str]:
    """The content that a picture of curves names."""
    return image_contents(path) if path.suffix.lower() == ".png" else report_contents(path)


def write_picture(path: Path, found: Convergence, content: str) -> None:
    """Draw error over samples and over seconds, both axes in logarithms; the file says its content."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    kind = path.suffix.lower()[1:]
    with rc_context({"svg.hashsalt": "illum", "font.size": 9}):
        figure = Figure(figsize=(9, 4), layout="constrained")
        over_count, over_seconds = figure.subplots(1, 2, sharey=True)
        for curve in found.curves:
            shown = [p for p in curve.points if p.rmse > 0]
            errors = [p.rmse for p in shown]
            name = f"{curve.sampler}, slope {curve.slope:.3f} ± {curve.slope_error:.3f}"
            over_count.loglog([p.count for p in shown], errors, "o-", base=2, label=name)
            over_seconds.loglog([p.seconds for p in shown], errors, "o-", label=curve.sampler)
        for axes in (over_count, over_seconds):
            axes.axhline(found.reference.rmse, color="0.6", linewidth=0.8, linestyle=":")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(visible=True, which="both", linewidth=0.3)
        over_count.set_xlabel("samples per pixel" if found.vary == "pixels" else "obscurance rays per pixel")
        over_seconds.set_xlabel(f"seconds, {found.threads} threads")
        over_count.set_ylabel(f"RMSE of {found.layer}")
        over_count.legend()
        figure.suptitle(f"{found.scene}, {found.width} x {found.height}")
        out = io.BytesIO()
        of_svg = {"Date": None, "Identifier": content, "Keywords": BLANK}
        about = of_svg if kind == "svg" else {"illum:content": content}
        figure.savefig(out, format=kind, dpi=150, metadata=about)
    if kind == "png":
        write_bytes(path, sealed_png(out.getvalue()))
    else:
        write_text(path, sealed_text(out.getvalue().decode()))
