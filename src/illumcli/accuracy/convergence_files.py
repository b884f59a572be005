"""The files of a convergence measurement: a table as CSV, and a plot of the curves."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path

from illumcli.accuracy.convergence import Convergence
from illumcli.accuracy.convergence_table import convergence_csv
from illumcli.cache.fingerprint import digest
from illumcli.errors import InputError
from illumcli.files.atomic import write_bytes, write_text
from illumcli.files.outputs import is_kept, refresh, refuse_suffix, refuse_unwritable
from illumcli.files.reports import report_contents
from illumcli.files.seal import BLANK, sealed_png, sealed_text
from illumcli.images.contents import image_contents


class ConvergenceFiles:
    """The files to write; files that already hold the same measurement are kept.

    Raises
    ------
    InputError
        A suffix that cannot be written; matplotlib is not installed.
    OutputError
        A file that cannot be written.
    """

    def __init__(self, table: Path | None, plot: Path | None, force: bool) -> None:
        self.kept: list[Path] = []
        self._table, self._plot, self._force = table, plot, force
        self._content = ""
        for path in (table, plot):
            if path is not None and not os.path.isfile(path):
                refuse_unwritable(path)
        if table is not None:
            refuse_suffix(table, "a table", ".csv")
        if plot is not None:
            refuse_suffix(plot, "a picture of curves", ".png", ".svg")
            try:
                import matplotlib.figure  # noqa: F401
            except ImportError:
                advice = "install it: pip install 'illumcli[plot]', or use --csv"
                raise InputError(f"pictures of curves need matplotlib; {advice}") from None

    def look(self, contents: Sequence[str]) -> None:
        """Find out which files already hold the measurement with these content hashes.

        Raises
        ------
        OutputError
            A different file exists and may not be replaced; a file cannot be written.
        """
        self._content = digest(contents)
        if self._table is not None and is_kept(self._table, contents, report_contents, self._force):
            self.kept.append(self._table)
        if self._plot is not None and is_kept(self._plot, [self._content], plot_contents, self._force):
            self.kept.append(self._plot)

    def write(self, result: Convergence) -> None:
        """Write the files that are not kept."""
        if self._table is not None and self._table not in self.kept:
            write_text(self._table, convergence_csv(result))
        if self._plot is not None and self._plot not in self.kept:
            write_plot(self._plot, result, self._content)
        for path in self.kept:
            refresh(path)


def plot_contents(path: Path) -> list[str]:
    """The content hashes in a plot of curves."""
    return image_contents(path) if path.suffix.lower() == ".png" else report_contents(path)


def write_plot(path: Path, result: Convergence, content: str) -> None:
    """Plot error over samples and over seconds on logarithmic axes; the file holds the content hash."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    kind = path.suffix.lower()[1:]
    with rc_context({"svg.hashsalt": "illum", "font.size": 9}):
        # The curves.
        figure = Figure(figsize=(9, 4), layout="constrained")
        over_count, over_seconds = figure.subplots(1, 2, sharey=True)
        for curve in result.curves:
            shown = [p for p in curve.points if p.rmse > 0]
            errors = [p.rmse for p in shown]
            name = f"{curve.sampler}, slope {curve.slope:.3f} ± {curve.slope_error:.3f}"
            over_count.loglog([p.count for p in shown], errors, "o-", base=2, label=name)
            over_seconds.loglog([p.seconds for p in shown], errors, "o-", label=curve.sampler)

        # The error of the reference, grid and labels.
        for axes in (over_count, over_seconds):
            axes.axhline(result.reference.rmse, color="0.6", linewidth=0.8, linestyle=":")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(visible=True, which="both", linewidth=0.3)
        over_count.set_xlabel("samples per pixel" if result.vary == "pixels" else "obscurance rays per pixel")
        over_seconds.set_xlabel(f"seconds, {result.threads} threads")
        over_count.set_ylabel(f"RMSE of {result.layer}")
        over_count.legend()
        figure.suptitle(f"{result.scene}, {result.width} x {result.height}")

        # The file, with its content hash; the same curves give the same bytes.
        out = io.BytesIO()
        of_svg = {"Date": None, "Identifier": content, "Keywords": BLANK}
        metadata = of_svg if kind == "svg" else {"illum:content": content}
        figure.savefig(out, format=kind, dpi=150, metadata=metadata)
    if kind == "png":
        write_bytes(path, sealed_png(out.getvalue()))
    else:
        write_text(path, sealed_text(out.getvalue().decode()))
