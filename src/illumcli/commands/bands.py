"""Pictures that are large beside the share of a worker, in bands of rows that are units of work."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from illumcli.commands.options import RenderJob
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.report import Report
from illumcli.commands.targets import band_of
from illumcli.commands.unit import Unit
from illumcli.commands.unit_cost import cost_of
from illumcli.errors import InputError
from illumcli.files.names import band_path, rows_of_band_files
from illumcli.film.develop import Target
from illumcli.film.view import View
from illumcli.images.contents import image_contents
from illumcli.render_graph.costs import CostModel

LEAST = 1 << 24
"""A picture that costs less [obscurance rays] stays whole: some 2 s of a core."""
BANDS = 4
"""Bands of one worker's share: rows do not cost the same."""
ROWS = 64
"""Bands begin at multiples of so many rows."""


def band_counts(costs: Sequence[int], workers: int) -> list[int]:
    """In how many bands each of some pictures is cut, by what they cost [obscurance rays]."""
    if workers < 2:
        return [1] * len(costs)
    share = sum(costs) // workers
    return [-(-BANDS * cost // share) if cost >= max(LEAST, share / 2) else 1 for cost in costs]


def rows_of_bands(view: View, count: int) -> list[tuple[int, int]]:
    """The rows of at most `count` bands of a picture, from the first to before the second."""
    rows = max(1, -(-view.height // (ROWS * count))) * ROWS
    return [(first, min(first + rows, view.height)) for first in range(0, view.height, rows)]


def in_bands(job: RenderJob, camera: str, rows: Sequence[tuple[int, int]]) -> list[RenderJob]:
    """The units of what a camera sees in these bands."""
    of_camera = replace(job, cameras=(camera,))
    return [replace(of_camera, rows=each) for each in rows] if len(rows) > 1 else [of_camera]


def remove_bands(picture: Target) -> None:
    """Remove the bands of a picture, also those that an interrupted command has cut otherwise."""
    for rows in rows_of_band_files(picture.path):
        band = band_of(picture, rows)
        with suppress(InputError, KeyError, OSError, ValueError):  # a file of another program, or removed
            if image_contents(band.path) == [band.content]:
                band.path.unlink()


class CutJobs:
    """Those jobs of `illum render` that are large beside the share of a worker, in bands."""

    def __init__(self, jobs: RenderJobs) -> None:
        self._jobs = jobs
        self._rows: dict[int, dict[str, list[tuple[int, int]]]] = {}
        """Number of a job -> camera -> rows of its bands."""

    def parts(self, due: Sequence[int], workers: int) -> dict[int, list[Unit]]:
        """Number of a job that is cut -> its units."""
        if len(due) > BANDS * workers:
            return {}
        works = [self._jobs.work(number) for number in due]
        costs = [cost_of(work, CostModel()).alone for work in works]
        parts = dict[int, list[Unit]]()
        for number, work, count in zip(due, works, band_counts(costs, workers), strict=True):
            views = {target.view.name: target.view for target in work.targets}
            rows = {name: rows_of_bands(view, count) for name, view in views.items()}
            is_cut = count > 1 and any(len(each) > 1 for each in rows.values())
            if is_cut and not work.whole_because:
                self._rows[number] = rows
                parts[number] = [unit for name in rows for unit in in_bands(work.job, name, rows[name])]
        return parts

    def join(self, number: int, results: Sequence[tuple[list[Path], Report]]) -> tuple[list[Path], Report]:
        """The files and the report of a job, from those of its units."""
        from illumcli.images.picture_bands import join_bands  # loads OpenImageIO, which plans do not need

        work, rows = self._jobs.work(number), self._rows[number]
        due = [target for target in work.due() if len(rows[target.view.name]) > 1]
        for target in due:
            bands = [band_path(target.path, each) for each in rows[target.view.name]]
            join_bands(bands, target.path)
            remove_bands(target)
        paths = [target.path for target in work.targets]
        written = {str(target.path) for target in due} | {
            path for _, report in results for path in report.written
        }
        return paths, report_of_pictures([report for _, report in results], work.content, paths, written)


def report_of_pictures(
    reports: Sequence[Report], content: str, paths: Sequence[Path], written: Collection[str]
) -> Report:
    """The report of the pictures in some files, from those of their parts; files not `written` are kept."""
    names = [str(path) for path in paths]
    return replace(
        reports[0].joined(reports[1:]),
        scene_hash=content,
        written=tuple(name for name in names if name in written),
        kept=tuple(name for name in names if name not in written),
    )
