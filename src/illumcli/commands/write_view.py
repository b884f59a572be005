"""Write the files of one view, band by band as they are rendered."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from illumcli import __version__
from illumcli.commands.work import Work
from illumcli.film.develop import ErrorSums, Target, how_to_read
from illumcli.film.tiles import Tile
from illumcli.graph import Buffers
from illumcli.images.format import RESERVED
from illumcli.progress import Progress
from illumcli.records import Value
from illumcli.render_graph.execute import Run, bands
from illumcli.render_graph.needs import reconstructs
from illumcli.render_graph.schedule import Plan
from illumcli.render_graph.tile_nodes import Planes
from illumcli.render_space import RenderSpace
from illumcli.scene.spec import Scene

if TYPE_CHECKING:
    from illumcli.accuracy.audit import Audit, AuditedError


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
    """Write one view's files band by band."""
    from illumcli.images.writer import ImageWriter

    view, space, development = plan.view, shared["render_space"], work.development

    # Called after each tile: report the progress.
    done, pixels = 0, view.width * view.height

    def advance(count: int) -> None:
        nonlocal done
        done += count
        progress(view.name, done, pixels)

    # Called by the threads for each tile: turn layers into values of the files.
    audit, known = _audit(work, plan), work.audited.get(view.name)
    stated = audit.layer.name if audit is not None else known.layer if known is not None else None

    def develop(tile: Tile, layers: Planes) -> dict[str, NDArray[Any]]:
        if audit is not None:
            audit.take(tile, layers)
        files = {str(target.path): development.pixels(target, tile, layers, space) for target in targets}
        return files | ({"error": layers["error"]} if "error" in layers else {})

    # Open all files; each gets its name only when all of it is written.
    sums, error = ErrorSums(), known
    with ExitStack() as files:
        writers = [
            files.enter_context(
                ImageWriter(
                    target.path,
                    view.width,
                    view.height,
                    development.channels(target),
                    metadata(work.scene, target, space) | _room(target, stated),
                    srgb=target.layers[0].kind == "light",
                )
            )
            for target in targets
        ]

        # Render and write band by band.
        for band in bands(plan, shared, run, advance, develop=develop):
            start = time.perf_counter()
            if "error" in band.layers:
                sums.add(band.layers["error"])
            for target, writer in zip(targets, writers, strict=True):
                writer.write_band(band.y, band.layers[str(target.path)])
            run.stats.add({"write": time.perf_counter() - start}, {})

        # Measure the error of reconstructed obscurance, and write it beside the layer.
        if audit is not None:
            start, auditing = time.perf_counter(), Run(threads=run.threads)
            error = audit.error(shared, auditing)
            rays = sum(auditing.stats.rays.values())
            run.stats.add({"audit": time.perf_counter() - start}, {"audit": rays})
        if error is not None:
            for target, writer in zip(targets, writers, strict=True):
                for name in _room(target, stated):
                    writer.set_text(name, str(error))

        # Finish and verify the files.
        start = time.perf_counter()
        clamped = sum(writer.close().clamped for writer in writers)
        run.stats.add({"write": time.perf_counter() - start}, {})
    return ViewOutcome(clamped, sums, error)


def _audit(work: Work, plan: Plan) -> Audit | None:
    """The audit of a view; None if nothing is reconstructed, or the job has no audit."""
    if not (work.job.options.audit and reconstructs(work.scene)):
        return None
    from illumcli.accuracy.audit import Audit, audited_layer

    layer = audited_layer(plan)
    return Audit.of(plan, layer, work.scene.seed) if layer is not None else None


def _room(target: Target, stated: str | None) -> dict[str, str]:
    """Room in the metadata of a file for the error of a layer, where it holds that layer."""
    return {"illum:audited_error": RESERVED} if stated in {layer.name for layer in target.layers} else {}


def metadata(scene: Scene, target: Target, space: RenderSpace) -> dict[str, Any]:
    """The metadata of a file."""
    return {
        "Software": f"illum {__version__}",
        "illum:version": __version__,
        "illum:content": target.content,
        "illum:camera": target.view.name,
        "illum:layers": ",".join(layer.name for layer in target.layers),
        "illum:samples": target.view.samples,
        "illum:seed": str(scene.seed),
        "illum:exposure": scene.film.exposure,
        "illum:obscurance_samples": scene.obscurance.samples if scene.obscurance else 0,
        "illum:obscurance_reconstructed": int(reconstructs(scene)),
        **how_to_read(target, space),
    }
