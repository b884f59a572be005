"""The audit of a view with reconstructed obscurance, and the layer `error` that is made of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from illumcli.arrays import Floats
from illumcli.commands.work import Work
from illumcli.film.tiles import Tile
from illumcli.graph import Buffers
from illumcli.render_graph.execute import Band, Run
from illumcli.render_graph.needs import reconstructs
from illumcli.render_graph.schedule import Plan, error_is_audited
from illumcli.render_graph.tile_nodes import Develop

if TYPE_CHECKING:
    from illumcli.accuracy.audit import Audit, AuditedError, Draws


def audit_of(work: Work, plan: Plan) -> Audit | None:
    """The audit of a view; None if nothing is reconstructed, or the job has no audit and no layer of one."""
    is_asked = work.job.options.audit or error_is_audited(work.scene, plan.outputs)
    if not (is_asked and reconstructs(work.scene)):
        return None
    from illumcli.accuracy.audit import Audit, audited_layer

    layer = audited_layer(plan)
    if layer is None:
        return None
    audit, precision = Audit.of(plan, layer, work.scene.seed), work.job.options.audit_precision
    return audit if precision is None else replace(audit, precision=precision)


def measured(
    audit: Audit, shared: Buffers, run: Run, advance: Callable[[int], None]
) -> tuple[AuditedError, Draws]:
    """The error of a picture, and the draws that state it; adds to the run's statistics.

    Parameters
    ----------
    advance : callable
        Called now and then with 0; an exception that it raises ends the audit.
    """
    start, auditing = time.perf_counter(), Run(threads=run.threads)
    error, draws = audit.measured(shared, auditing, advance)
    rays = sum(auditing.stats.rays.values())
    run.stats.add({"audit": time.perf_counter() - start}, {"audit": rays})
    return error, draws


def bands_with_errors(held: Sequence[Band], errors: Floats, develop: Develop) -> Iterator[Band]:
    """Developed bands of a picture.

    Parameters
    ----------
    held : sequence of Band
        Its layers.
    errors : (H, W, 1) float32
        Its layer `error`.
    """
    for band in held:
        rows = errors[band.y : band.y + len(next(iter(band.layers.values())))]
        tile = Tile(0, band.y, rows.shape[1], rows.shape[0])
        yield Band(band.y, develop(tile, {**band.layers, "error": rows}))
