"""What runs in the process of a worker: blocks of units, one after the other."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from pathlib import Path
from tempfile import mkdtemp
from threading import Lock
from traceback import format_exception
from typing import TYPE_CHECKING, Any, cast

from distributed import WorkerPlugin, get_worker

from illumcli.baking.occluder_choice import with_files_at
from illumcli.cluster.facts import differences, facts
from illumcli.cluster.inputs import Mirror, is_shared
from illumcli.commands.options import RenderJob
from illumcli.commands.unit import Unit, Worker
from illumcli.commands.work import Work
from illumcli.errors import IllumError, LimitError, OutputError, known
from illumcli.files.atomic import is_full
from illumcli.gonioreflectometer.work import MeasureRow
from illumcli.records import Value

if TYPE_CHECKING:
    from illumcli.baking.inputs import BakeWork
    from illumcli.baking.report import BakeReport
    from illumcli.commands.report import Report
    from illumcli.gonioreflectometer.estimate import Estimate
    from illumcli.gonioreflectometer.work import MeasureWork

ONE_BLOCK = Lock()
"""Held while a block is done: the current folder belongs to the whole process."""
WRITTEN_OR_KEPT = ("written", "kept")
"""Fields of reports with the names of files."""


class Command(Value):
    """What all units of a command share."""

    name: str
    """Unique."""
    folder: str
    """The current folder of the client, which relative names are relative to."""
    token: Mapping[Path, str]
    """Files of the client by their hashes: a worker that sees them shares its file system."""
    facts: Mapping[str, str]
    """Those of the client that workers must share."""
    allowed: str
    """The client's ILLUM_ALLOW."""
    models: tuple[Path, ...]
    """The folders of the client's ILLUM_MODELS."""


class UnitResult(Value):
    """The files and the report of a unit, or its error."""

    result: Any = None
    error: IllumError | None = None
    is_disk_full: bool = False
    lies_with_worker: bool = False
    """True if the worker's own disk was full, or it had too little memory."""
    contents: Mapping[str, bytes] = field(default_factory=dict)
    """The files that were written, by their names, where the client does not see them."""


class BlockResult(Value):
    """The results of a block of units."""

    worker: str
    done: tuple[UnitResult, ...] = ()
    lacks_files: bool = False
    """True if nothing was done: the worker does not see the client's files."""
    lacking: tuple[Path, ...] = ()
    """Files that it is known to need first."""
    seconds: float = 0.0
    """What they took."""
    differences: tuple[str, ...] = ()
    """How the worker differs from the client, if it may not: nothing was done."""
    fault: str = ""
    """Traceback of a fault of the program. Dask's client waits for ever for errors that cannot be pickled."""


class CommandPlugin(WorkerPlugin):
    """What a worker holds for one command: a `Worker`, and copies of the client's files."""

    idempotent = True

    def __init__(self, command: Command) -> None:
        self.command = command
        self.name = command.name
        self.worker: Worker | None = None
        self.mirror: Mirror | None = None
        self.is_ended = False

    def teardown(self, worker: Any) -> None:
        """Remove the copies; a unit that is in work is done to its end, those after it are not."""
        self.is_ended = True
        if ONE_BLOCK.acquire(blocking=False):  # otherwise the block that is in work removes them
            self._remove_copies()
            ONE_BLOCK.release()

    @contextmanager
    def entered(self, folder: str) -> Iterator[Worker]:
        """In the client's folder, what does its units; copies of its files go below `folder`."""
        with ONE_BLOCK:
            before, allowed = os.getcwd(), os.environ.get("ILLUM_ALLOW", "")
            models = os.environ.get("ILLUM_MODELS", "")
            try:
                if self.worker is None:
                    if not is_shared(self.command.token):
                        self.mirror = Mirror(Path(mkdtemp(prefix="illum-", dir=folder)))
                    self.worker = Worker()
                folders = self.command.models
                if self.mirror is not None:
                    self.mirror.enter(self.command.folder)
                    folders = tuple(self.mirror.at(each) for each in folders)
                else:
                    os.chdir(self.command.folder)
                    os.environ["ILLUM_ALLOW"] = self.command.allowed
                os.environ["ILLUM_MODELS"] = os.pathsep.join(map(str, folders))
                yield self.worker
            finally:
                os.chdir(before)
                os.environ["ILLUM_ALLOW"] = allowed
                os.environ["ILLUM_MODELS"] = models
                if self.is_ended:
                    self._remove_copies()

    def _remove_copies(self) -> None:
        if self.mirror is not None:
            shutil.rmtree(self.mirror.root, ignore_errors=True)


def do(
    command: Command,
    units: Sequence[Unit],
    following: Unit | None,
    digests: Mapping[Path, str] | None,
    contents: Mapping[Path, bytes] | None,
) -> BlockResult:
    """Do a block of units of a command.

    Parameters
    ----------
    command : Command
        Workers of a scheduler that was started again do not know it yet.
    following : Unit, optional
        What is likely to come next: buffers that it reads, too, stay in memory.
    digests : mapping, optional
        Every file that the units read, and its hash; not given until a worker lacks files.
    contents : mapping, optional
        Files that this worker said to lack.
    """
    dask_worker = get_worker()
    address = dask_worker.address
    plugin = cast(CommandPlugin, dask_worker.plugins.setdefault(command.name, CommandPlugin(command)))
    if differing := differences(facts(), command.facts):
        return BlockResult(address, differences=differing)
    began = time.perf_counter()
    try:
        with plugin.entered(dask_worker.local_directory) as worker:
            if (mirror := plugin.mirror) is not None:
                mirror.add(contents or {})
                lacking = mirror.lacking(digests or {})
                if digests is None or lacking:
                    return BlockResult(address, lacks_files=True, lacking=tuple(lacking))
                units = [_mirrored(unit, mirror) for unit in units]
                following = following and _mirrored(following, mirror)
            done = _all_done(plugin, worker, units, following)
            worker.finish()
    except Exception as error:
        if known(error) is None:
            return BlockResult(address, fault="".join(format_exception(error)))
        done = (_failed(error, has_own_disk=True),) * len(units)
    return BlockResult(address, done, seconds=time.perf_counter() - began)


def _all_done(
    plugin: CommandPlugin, worker: Worker, units: Sequence[Unit], following: Unit | None
) -> tuple[UnitResult, ...]:
    """The results of units in their order, until the client ends.

    Buffers that the next one reads stay in memory.
    """
    done, work = [], _prepared(worker, units[0])
    for unit in (*units[1:], following):
        if plugin.is_ended:
            break
        upcoming = None if unit is None else _prepared(worker, unit)
        done.append(work if isinstance(work, UnitResult) else _done(worker, work, upcoming, plugin.mirror))
        work = upcoming or work
    return tuple(done)


def _prepared(worker: Worker, unit: Unit) -> Work | BakeWork | MeasureWork | UnitResult:
    """The work of a unit, or the result of one with a fault."""
    try:
        return worker.prepare(unit)
    except Exception as error:
        return _failed(error)


def _done(
    worker: Worker,
    work: Work | BakeWork | MeasureWork,
    following: Work | BakeWork | MeasureWork | UnitResult | None,
    mirror: Mirror | None,
) -> UnitResult:
    """The result of a unit."""
    report: Report | BakeReport | Estimate
    try:
        if isinstance(work, Work):
            paths, report = worker.run(work, following=following if isinstance(following, Work) else None)
        else:
            paths, report = worker.run(work)
    except Exception as error:
        return _failed(error, mirror is not None)
    if mirror is None or not paths:
        return UnitResult((paths, report))
    return _shipped(paths, report, str(mirror.root))


def _failed(error: Exception, has_own_disk: bool = False) -> UnitResult:
    """The result of a unit that failed; a fault of the program is raised again."""
    failure = known(error)
    if failure is None:
        raise error
    full = isinstance(failure, OutputError) and is_full(failure)
    own = (full and has_own_disk) or isinstance(failure, LimitError)
    return UnitResult(error=failure, is_disk_full=full and not has_own_disk, lies_with_worker=own)


def _shipped(paths: Sequence[Path], report: Any, prefix: str) -> UnitResult:
    """The result of a unit whose files are moved from below `prefix` to the client."""
    contents = {path: path.read_bytes() for path in paths}
    for path in paths:
        path.unlink()
    names = [Path(str(path).removeprefix(prefix)) for path in paths]
    shown = {
        key: tuple(str(each).removeprefix(prefix) for each in getattr(report, key)) for key in WRITTEN_OR_KEPT
    }
    by_name = {str(name): content for name, content in zip(names, contents.values(), strict=True)}
    return UnitResult((names, replace(report, **shown)), contents=by_name)


def _mirrored(unit: Unit, mirror: Mirror) -> Unit:
    """The unit with absolute names in the mirror; relative ones stay as they are."""

    def at(path: Path) -> Path:
        return mirror.at(path) if path.is_absolute() else path

    if isinstance(unit, MeasureRow):
        if not unit.files():
            return unit
        path = at(unit.path)
        return replace(unit, path=path, source=replace(unit.source, text=str(path)))
    if isinstance(unit, RenderJob):
        pattern = unit.options.pattern
        options = replace(unit.options, pattern=str(at(Path(pattern))) if pattern else None)
        return replace(unit, scene=at(unit.scene), options=options)
    occluders = with_files_at(unit.settings.occluders, at)
    return replace(
        unit,
        path=at(unit.path),
        outputs=tuple(at(each) for each in unit.outputs),
        settings=replace(unit.settings, occluders=occluders),
    )
