"""Bake several inputs: what is wrong with any of them is told before the first ray, the others are done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from illumcli.baking.bake import Report, Settings, Work, baked, prepared
from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.render import Progress
from illumcli.files.names import check_unique, expand
from illumcli.records import Value


class Asked(Value):
    """What all inputs are baked with, and how."""

    settings: Settings
    patterns: tuple[str, ...]
    """Of the outputs' names; `{scene}` is the input's name without its suffix."""
    overrides: tuple[str, ...] = ()
    threads: int | None = None
    force: bool = False
    strict: bool = False
    keep_going: bool = True

    def outputs(self, path: Path) -> list[Path]:
        """The files of one input."""
        return [Path(expand(pattern, {"scene": path.stem})) for pattern in self.patterns]

    def prepared(self, path: Path) -> Work:
        """An input whose meshes are read."""
        return prepared(path, self.outputs(path), self.settings, self.overrides, self.force, self.strict)


def run(
    inputs: Sequence[Path],
    asked: Asked,
    report: Path | None,
    progress: Progress,
    written: Callable[[Path, list[Path], Report], None],
    tell: Tell,
) -> bool:
    """Bake every input; is the report kept, since it holds the same as it would?

    `written` gets each input that is done, its files and report, `tell` the fault of each that is not.

    Raises
    ------
    IllumError
        At last, where any input failed; at once, where files have one name or the report cannot be written.
    """
    batch = Batch("inputs", len(inputs), asked.keep_going, tell)
    whole = BatchReport(report, [{"input": str(path)} for path in inputs])
    check_unique([str(each) for path in dict.fromkeys(inputs) for each in asked.outputs(path)])

    # all that can be known before the first ray; the meshes of one input alone are held meanwhile
    lone: Work | None = None
    for number in batch.due():
        with batch.piece(number):
            work = asked.prepared(inputs[number])
            whole.plan(number, digest((work.content, [str(each) for each in work.outputs])))
            lone = work if len(inputs) == 1 else None
            del work
    whole.look(asked.force)

    for number in batch.due():
        with batch.piece(number):
            paths, done = baked(
                lone or asked.prepared(inputs[number]), asked.settings, asked.threads, progress
            )
            whole.add(number, done.as_data())
            written(inputs[number], paths, done)
    return whole.finish(batch)
