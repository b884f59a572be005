"""Bake several inputs: faults of any of them are known before the first ray, and the others are baked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from illumcli.baking.bake import bake_prepared
from illumcli.baking.inputs import BakeWork, prepare_bake
from illumcli.baking.report import BakeReport
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.files.names import check_unique, expand
from illumcli.progress import Progress
from illumcli.records import Value


class BakeRequest(Value):
    """What all inputs are baked with."""

    settings: BakeSettings
    patterns: tuple[str, ...]
    """Of the outputs' names; `{scene}` is the input's name without its suffix."""
    options: BakeOptions = BakeOptions()
    keep_going: bool = True

    def outputs(self, path: Path) -> list[Path]:
        """The files of one input."""
        return [Path(expand(pattern, {"scene": path.stem})) for pattern in self.patterns]

    def prepare(self, path: Path) -> BakeWork:
        """An input whose meshes were read."""
        return prepare_bake(path, self.outputs(path), self.settings, self.options)


def bake_inputs(
    inputs: Sequence[Path],
    request: BakeRequest,
    report: Path | None,
    progress: Progress,
    written: Callable[[Path, list[Path], BakeReport], None],
    tell: Tell,
) -> bool:
    """Bake every input; is the report file kept, since it would hold the same?

    `written` gets each input that is done, its files and report, `tell` the fault of each that failed.

    Raises
    ------
    IllumError
        At the end, where any input failed; at once, where files have equal names or the report cannot be
        written.
    """
    batch = Batch("inputs", len(inputs), request.keep_going, tell)
    entries = BatchReport(report, [{"input": str(path)} for path in inputs])
    check_unique([str(each) for path in dict.fromkeys(inputs) for each in request.outputs(path)])

    # faults that can be known before the first ray; only a lone input's meshes are held meanwhile
    lone: BakeWork | None = None
    for index in batch.due():
        with batch.piece(index):
            work = request.prepare(inputs[index])
            entries.plan(index, digest((work.content, [str(each) for each in work.outputs])))
            lone = work if len(inputs) == 1 else None
            del work
    entries.look(request.options.force)

    # the bakes
    for index in batch.due():
        with batch.piece(index):
            work = lone or request.prepare(inputs[index])
            paths, done = bake_prepared(work, request.options.threads, progress)
            entries.add(index, done.as_data())
            written(inputs[index], paths, done)
    return entries.finish(batch)
