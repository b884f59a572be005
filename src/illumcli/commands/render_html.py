"""The report for a browser of several scenes, or of the frames of one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from illumcli.cache.fingerprint import digest
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.report import Report
from illumcli.commands.sweep_html import is_html_kept, pictures_of, render_command, write_html
from illumcli.commands.sweep_outcome import PlannedVariant
from illumcli.commands.sweep_works import planned_variant
from illumcli.commands.work import Work
from illumcli.files.outputs import INCOMPLETE
from illumcli.html_report.entries import PAGE, Contents, Entry


class RenderPage:
    """What the report says of each job of `illum render`."""

    def __init__(self, folder: Path, jobs: RenderJobs) -> None:
        self._folder, self._jobs = folder, jobs
        self._planned: dict[int, PlannedVariant] = {}
        self._reports: dict[int, Report] = {}
        self._is_kept = False

    def plan(self, number: int, work: Work) -> None:
        """Note the pictures of a job."""
        self._planned[number] = planned_variant(work)

    def look(self, force: bool) -> None:
        """Check whether the report exists with these pictures; without `force` refuse a different one."""
        self._is_kept = is_html_kept(self._folder, self._contents(), force)

    def add(self, number: int, report: Report) -> None:
        """Note what became of a job."""
        self._reports[number] = report

    def write(self, failures: Mapping[int, Exception]) -> list[Path]:
        """Write the report, unless it is kept. Returns the path of its page if it is."""
        if self._is_kept and not failures:
            return [self._folder / PAGE]
        entries = tuple(self._entry(number, failures) for number in range(len(self._jobs)))
        scenes = dict.fromkeys(job.scene.stem for job in self._jobs)
        title = ", ".join(scenes) if len(scenes) < 4 else f"{len(scenes)} scenes"
        noun = "frame" if any(job.frame is not None for job in self._jobs) else "scene"
        seconds = sum(report.total_seconds for report in self._reports.values())
        first = next(iter(self._planned.values()), None)
        ratio = first.height / first.width if first is not None else 1.0
        write_html(self._folder, Contents(title, entries, seconds, ratio, noun))
        return []

    def _contents(self) -> list[str]:
        """Hash of what the entry of each job depends on."""
        return [self._content(number) for number in range(len(self._jobs))]

    def _content(self, number: int) -> str:
        planned = self._planned.get(number)
        return INCOMPLETE if planned is None else digest((planned.content, [*map(str, planned.paths)]))

    def _entry(self, number: int, failures: Mapping[int, Exception]) -> Entry:
        job, report, planned = self._jobs.unit(number), self._reports.get(number), self._planned.get(number)
        frame = {} if job.frame is None else {"frame": str(job.frame)}
        error = failures.get(number)
        return Entry(
            label=", ".join(filter(None, (job.scene.stem, self._jobs.label(number)))),
            values={"scene": job.scene.stem, **frame},
            content=self._content(number) if report is not None else INCOMPLETE,
            state=_state(report, error),
            command=render_command(job),
            error=None if error is None else str(error),
            measures={"seconds": report.total_seconds, "rays": sum(report.rays.values())} if report else {},
            pictures=pictures_of(planned) if planned is not None and report is not None else {},
        )


def _state(report: Report | None, error: Exception | None) -> str:
    if report is None:
        return "pending" if error is None else "failed"
    return "rendered" if report.written else "kept"
