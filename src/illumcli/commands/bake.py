"""Bake several inputs: faults are reported before the first ray, and the other inputs are baked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from illumcli.baking.inputs import BakeWork
from illumcli.baking.report import BakeReport
from illumcli.baking.settings import BakeJob, BakeOptions, BakeSettings
from illumcli.baking.texture_slots import is_texture
from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.options import Shard
from illumcli.commands.runner import PlannedPieces, Runner
from illumcli.commands.unit import Worker
from illumcli.files.names import check_unique, expand, expand_some
from illumcli.progress import Progress
from illumcli.records import Value


class BakeRequest(Value):
    """The settings that all inputs are baked with."""

    settings: BakeSettings
    patterns: tuple[str, ...]
    """Patterns of the outputs' names; `{name}` and `{scene}` are the input's name without its suffix."""
    preview: str | None = None
    """Pattern of the previews' names."""
    options: BakeOptions = BakeOptions()
    keep_going: bool = True
    shard: Shard | None = None
    """The part of the inputs that is baked; by default all."""

    def refuse_shared_outputs(self, inputs: Sequence[Path]) -> None:
        """Raise InputError for all files that several inputs would write; an input may be given twice."""
        jobs = [self.job(path) for path in dict.fromkeys(inputs)]
        files = [(str(each), str(job.path)) for job in jobs for each in (*job.outputs, *job.previews)]
        check_unique(*zip(*files, strict=True))

    def job(self, path: Path) -> BakeJob:
        """The unit of work of one input."""
        fields = {"name": path.stem, "scene": path.stem}
        outputs = [
            Path((expand_some if is_texture(Path(pattern)) else expand)(pattern, fields))
            for pattern in self.patterns
        ]
        preview = None if self.preview is None else Path(expand(self.preview, fields))
        return BakeJob(path, tuple(outputs), self.settings, self.options, preview)


def bake_inputs(
    inputs: Sequence[Path],
    request: BakeRequest,
    report: Path | None,
    runner: Runner,
    written: Callable[[Path, list[Path], BakeReport], None],
    tell: Tell,
) -> list[Path]:
    """Bake every input. Returns the report's path if it is kept because it would be the same.

    `written` is called with each finished input, its files and report; `tell` with the errors of the others.

    Raises
    ------
    IllumError
        At the end if any input failed; at once if files have equal names or the report cannot be written.
    """
    worker, batch = Worker(), Batch("inputs", len(inputs), request.keep_going, tell)
    entries = BatchReport(report, [{"input": str(path)} for path in inputs])
    request.refuse_shared_outputs(inputs)

    # Find faults before the first ray. The meshes of a single input are kept for its bake.
    single: BakeWork | None = None
    planned = PlannedPieces()
    for index in batch.due():
        with batch.piece(index):
            work = worker.prepare(request.job(inputs[index]))
            entries.plan(index, digest((work.content, [str(each) for each in work.outputs])))
            planned.add(index, work)
            single = work if len(inputs) == 1 else None
            del work
    entries.look(request.options.force)

    # Bake.
    def run(index: int, progress: Progress) -> tuple[list[Path], BakeReport]:
        return worker.run(single or worker.prepare(request.job(inputs[index])), progress)

    pieces = planned.pieces(lambda index: request.job(inputs[index]), run)
    for index, result in runner.results(batch, pieces):
        with batch.piece(index):
            paths, done = result()
            entries.add(index, done.as_data())
            written(inputs[index], paths, done)
    return entries.finish(batch)
