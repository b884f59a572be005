"""Units of work that are no renders: bakes with their previews, and rows of measurements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from illumcli.baking.inputs import BakeWork, prepare_bake
from illumcli.baking.settings import BakeJob
from illumcli.progress import Progress

if TYPE_CHECKING:
    from illumcli.baking.report import BakeReport
    from illumcli.gonioreflectometer.estimate import Estimate
    from illumcli.gonioreflectometer.rows import Instrument
    from illumcli.gonioreflectometer.work import MeasureRow, MeasureWork


def prepared(unit: BakeJob | MeasureRow, instruments: dict[object, Instrument]) -> BakeWork | MeasureWork:
    """The work of a unit; a new instrument is added to those at hand.

    Raises
    ------
    InputError, LimitError, OutputError
        Any fault that can be found before the first ray.
    """
    if not isinstance(unit, BakeJob):
        return unit.prepared(instruments)
    work = prepare_bake(unit)
    if unit.preview is not None:
        from illumcli.baking.preview import refuse_preview

        refuse_preview(work)
    return work


def done(
    work: BakeWork | MeasureWork, progress: Progress
) -> tuple[list[Path], BakeReport] | tuple[list[Path], Estimate]:
    """The files and the report of a unit, or the cells of a row, which has no files."""
    if not isinstance(work, BakeWork):
        return [], work.run(progress)
    from illumcli.baking.bake import bake_prepared

    baked = bake_prepared(work, progress)
    if work.job.preview is None:
        return baked
    from illumcli.baking.preview import with_preview

    return with_preview(work, *baked)
