"""Units of work: one description, and one class that does it, for threads, shards and workers of a cluster.

A unit is a scene, a variant or a frame of it, some or all of its cameras, a band of their rows (`RenderJob`),
an input of a bake (`BakeJob`), a row of a measurement (`MeasureRow`). It holds names and numbers, no arrays
and no open files, and can be pickled. Its files depend on the unit and on the files that it names: not on
the process, the number of threads, or earlier units. Its key is the `content` of its work: files that exist
with this content are kept, whoever wrote them, so a unit that is done twice is computed once.

An executor makes one `Worker` per process and gives it units, one after the other:

    worker = Worker()
    for unit in units:
        work = worker.prepare(unit)    # raises the errors of the input; no ray is cast
        result = worker.run(work)      # writes the files, each complete or not at all
    worker.finish()                    # tidies the cache

Threads are inside: `run` uses `options.threads` of the unit, by default one per core, so one process per
machine suffices. A worker reads each scene and file once: make a new one for each command. Errors are
`IllumError`s, whose text is for the user; they can be pickled, and so can results.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, overload

from illumcli.cache.fingerprint import FileFingerprints
from illumcli.cache.location import open_store
from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.speeds import SpeedRecorder
from illumcli.cache.store import Store
from illumcli.commands.image_store import ImageFiles, ImageStore
from illumcli.commands.options import RenderJob
from illumcli.commands.work import Work, work_of
from illumcli.progress import Progress, no_progress
from illumcli.records import Record
from illumcli.scene.load import SceneText, load, read_text

if TYPE_CHECKING:
    from illumcli.baking.inputs import BakeWork
    from illumcli.baking.report import BakeReport
    from illumcli.baking.settings import BakeJob
    from illumcli.commands.report import Report
    from illumcli.gonioreflectometer.estimate import Estimate
    from illumcli.gonioreflectometer.rows import Instrument
    from illumcli.gonioreflectometer.work import MeasureRow, MeasureWork

Unit: TypeAlias = "RenderJob | BakeJob | MeasureRow"


class SharedParts(Record):
    """What the units of one scene share in a process."""

    text: SceneText
    files: FileFingerprints = field(default_factory=FileFingerprints)
    memory: MemoryCache = field(default_factory=MemoryCache)


class Worker:
    """Does units of work in one process; what those of one scene have in common is read and computed once."""

    def __init__(self, images: ImageStore = ImageFiles()) -> None:  # noqa: B008
        self._images = images
        self._scenes: dict[Path, SharedParts] = {}
        self._instruments: dict[object, Instrument] = {}
        self._speeds = SpeedRecorder()

    @cached_property
    def _store(self) -> Store | None:
        return open_store()

    def shared(self, scene: Path) -> SharedParts:
        """What the units of a scene share; the scene's text is read once."""
        if scene not in self._scenes:
            self._scenes[scene] = SharedParts(read_text(scene))
        return self._scenes[scene]

    def reread(self, scene: Path, text: SceneText) -> None:
        """Take a new text of a scene, and read its files again; buffers in memory are named by content, and
        stay."""
        self._scenes[scene] = SharedParts(text, memory=self.shared(scene).memory)

    @overload
    def prepare(self, unit: RenderJob) -> Work: ...
    @overload
    def prepare(self, unit: BakeJob) -> BakeWork: ...
    @overload
    def prepare(self, unit: MeasureRow) -> MeasureWork: ...
    def prepare(self, unit: Unit) -> Work | BakeWork | MeasureWork:
        """The work of a unit: its description read and checked, and its key, `content`.

        Raises
        ------
        InputError, LimitError, OutputError
            Any fault that can be found before the first ray.
        """
        if isinstance(unit, RenderJob):
            shared = self.shared(unit.scene)
            loaded = load(unit.scene, unit.options.overrides, shared.text, unit.frame)
            return replace(work_of(unit, loaded, shared.files), images=self._images)
        from illumcli.commands.other_units import prepared

        return prepared(unit, self._instruments)

    @overload
    def run(
        self, work: Work, progress: Progress = no_progress, following: Work | None = None
    ) -> tuple[list[Path], Report]: ...
    @overload
    def run(self, work: BakeWork, progress: Progress = no_progress) -> tuple[list[Path], BakeReport]: ...
    @overload
    def run(self, work: MeasureWork, progress: Progress = no_progress) -> tuple[list[Path], Estimate]: ...
    def run(
        self,
        work: Work | BakeWork | MeasureWork,
        progress: Progress = no_progress,
        following: Work | None = None,
    ) -> tuple[list[Path], Report] | tuple[list[Path], BakeReport] | tuple[list[Path], Estimate]:
        """Write the files of a unit that do not exist with its content. Returns all its files and the report.

        Buffers that the `following` work reads, too, stay in memory.
        """
        if not isinstance(work, Work):
            from illumcli.commands.other_units import done

            return done(work, progress)
        store = self._store if work.job.options.cache else None
        if work.job.options.target_error is not None:
            from illumcli.commands.target import rendered_to_target

            return rendered_to_target(work, store, progress)
        from illumcli.commands.render import rendered

        memory = self._scenes[work.job.scene].memory
        try:
            report = rendered(work, Cache(store, memory, self._speeds), progress, following)
        finally:
            memory.retire()
        return [target.path for target in work.targets], report

    def finish(self) -> tuple[str, ...]:
        """Tidy the cache on disk. Returns its warning, if it has one."""
        if "_store" not in vars(self) or self._store is None:
            return ()
        self._speeds.keep(self._store)
        self._store.finish()
        return (self._store.warning,) if self._store.warning else ()
