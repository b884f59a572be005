"""Write the files of one view, band by band as they are rendered."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from illumcli.commands.view_audit import audit_of, bands_with_errors, measured
from illumcli.commands.work import Work
from illumcli.film.develop import ErrorSums, Target
from illumcli.film.tiles import Tile
from illumcli.graph import Buffers
from illumcli.images.format import RESERVED
from illumcli.progress import Progress
from illumcli.records import Value
from illumcli.render_graph.execute import Band, Run, bands
from illumcli.render_graph.schedule import Plan, error_is_audited
from illumcli.render_graph.tile_nodes import Planes

if TYPE_CHECKING:
    from illumcli.accuracy.audit import AuditedError


class ViewOutcome(Value):
    """The result of writing a view."""

    clamped: int
    """Values beyond the range of half."""
    sums: ErrorSums
    """Sums over the layer `error`."""
    audited: AuditedError | None = None
    """The error of reconstructed obscurance."""


def write_view(
    work: Work,
    plan: Plan,
    shared: Buffers,
    targets: Sequence[Target],
    run: Run,
    progress: Progress,
) -> ViewOutcome:
    """Write one view's files band by band; all at once where an audit of the picture makes a layer."""
    view, space, development = plan.view, shared["render_space"], work.development

    # Called after each tile: report the progress.
    done, pixels = 0, view.width * targets[0].height

    def advance(count: int) -> None:
        nonlocal done
        done += count
        progress(view.name, done, pixels)

    # Called by the threads for each tile: turn layers into values of the files. If an audit makes the layer
    # `error`, the picture is held until then.
    audit, known = audit_of(work, plan), work.audited.get(view.name)
    is_held = error_is_audited(work.scene, plan.outputs)
    stated = audit.layer.name if audit is not None else known.layer if known is not None else None

    def develop(tile: Tile, layers: Planes) -> dict[str, NDArray[Any]]:
        files = {str(target.path): development.pixels(target, tile, layers, space) for target in targets}
        return files | ({"error": layers["error"]} if "error" in layers else {})

    def finish(tile: Tile, layers: Planes) -> Mapping[str, NDArray[Any]]:
        if audit is not None:
            audit.take(tile, layers)
        return layers if is_held else develop(tile, layers)

    # Open all files; each gets its name only when all of it is written.
    sums, error = ErrorSums(), known
    with ExitStack() as files:
        writers = [
            files.enter_context(work.images.open(work, target, space, _room(target, stated)))
            for target in targets
        ]

        def write(band: Band) -> None:
            start = time.perf_counter()
            if "error" in band.layers:
                sums.add(band.layers["error"])
            for target, writer in zip(targets, writers, strict=True):
                writer.write_band(band.y - (target.rows or (0,))[0], band.layers[str(target.path)])
            run.stats.add({"write": time.perf_counter() - start}, {})

        # Render band by band; a thread writes each while later ones are rendered or the picture is audited.
        developed: Iterable[Band] = bands(plan, shared, run, advance, develop=finish)
        if audit is not None and is_held:
            held = list(developed)
            error, draws = measured(audit, shared, run, advance)
            developed = bands_with_errors(held, audit.pixel_errors(draws), develop)
        writing = files.enter_context(ThreadPoolExecutor(1, thread_name_prefix="write"))
        previous: Future[None] | None = None
        for band in developed:
            if previous is not None:
                previous.result()
            previous = writing.submit(write, band)

        # Measure the error of reconstructed obscurance, and write it beside the layer.
        if audit is not None and not is_held:
            error, _ = measured(audit, shared, run, advance)
        if previous is not None:
            previous.result()
        if error is not None:
            for target, writer in zip(targets, writers, strict=True):
                for name in _room(target, stated):
                    writer.set_text(name, str(error))

        # Finish and verify the files.
        start = time.perf_counter()
        clamped = sum(writer.close().clamped for writer in writers)
        run.stats.add({"write": time.perf_counter() - start}, {})
    return ViewOutcome(clamped, sums, error)


def _room(target: Target, stated: str | None) -> dict[str, str]:
    """Room in the metadata of a file for the error of a layer, where it holds that layer."""
    return {"illum:audited_error": RESERVED} if stated in {layer.name for layer in target.layers} else {}
