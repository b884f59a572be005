"""``illum sweep``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from illumcli.cli._options import (
    FILE,
    RunnerOf,
    allow_option,
    cluster_options,
    force_option,
    gathered,
    html_option,
    json_results_option,
    keep_going_option,
    models_option,
    no_cache_option,
    only_option,
    pattern_option,
    quiet_option,
    render_options,
    scene_argument,
    seed_option,
    shard_option,
    strict_option,
    taken,
    threads_option,
    variants_options,
    verbose_option,
)
from illumcli.cli._printing import Results, say, say_kept

if TYPE_CHECKING:
    from illumcli.commands.options import RenderOptions
    from illumcli.commands.sweep_files import SweepFiles
    from illumcli.commands.sweep_outcome import Outcome
    from illumcli.scene.variants import Variant


def _files(options: dict[str, Any]) -> SweepFiles:
    from illumcli.commands.sweep_files import SweepFiles

    if options["columns"] is not None and options["sheet"] is None:
        raise click.UsageError("--columns is for --sheet; give --sheet, too")
    if options["reference"] is not None and options["table"] is None and options["html"] is None:
        raise click.UsageError("--reference is for the errors in --table and --html; give one of them, too")
    return taken(SweepFiles, options)


@click.command()
@scene_argument
@variants_options
@pattern_option
@only_option
@click.option("--sheet", type=FILE, metavar="FILE", help="Write a contact sheet, labelled: .png, .svg, .pdf.")
@click.option(
    "--columns",
    type=click.IntRange(1, 1000),
    help="Pictures along a row of the sheet; by default the last -D.",
)
@click.option("--table", type=FILE, metavar="FILE.csv", help="Write values, seconds, rays, mean, errors.")
@html_option
@click.option(
    "--reference",
    metavar="N|FILE",
    help="What errors are relative to: variant N, an image, or a pattern with an image for each.",
)
@click.option("--flip", "flips", is_flag=True, help="Measure FLIP, too, which takes far longer.")
@click.option("--report", type=FILE, metavar="FILE.json", help="Write every variant's report.")
@json_results_option
@click.option("--dry-run", is_flag=True, help="Print what the sweep would take, and render nothing.")
@seed_option("By default the scene's.")
@threads_option
@force_option("Replace files that differ, render those that do not.")
@keep_going_option
@cluster_options
@strict_option
@no_cache_option
@shard_option
@allow_option
@models_option
@quiet_option
@verbose_option
@gathered("files", _files)
@gathered("options", render_options)
def sweep(
    scene: Path,
    variants: list[Variant],
    options: RenderOptions,
    files: SweepFiles,
    runner: RunnerOf,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Render the variants of SCENE in one process; print the path of every image.

    Buffers that no override affects are computed once. An interrupted sweep resumes when it is started again:
    images with the same content are kept.

    \b
    Every value with every other, the last path fastest:
      illum sweep scene.yaml -D materials.clay.exponent=4:256:7log -D ambient=0.2,0.4 --sheet all.png
    A turntable: the eye on a circle, once around in 120 frames:
      illum sweep scene.yaml --frames 0:119 -D 'camera.position=[4*cos(frame*pi/60), 1, 4*sin(frame*pi/60)]'
    """
    from illumcli.cli._progress import reporter
    from illumcli.commands.sweep import sweep_scene
    from illumcli.render_graph.repairs import repair_lines
    from illumcli.scene.problems import without_frame

    if dry_run:
        import json

        from illumcli.commands.plan import ScenePlan
        from illumcli.commands.plan_table import variants_table

        parts = ScenePlan(scene, variants, options, is_sweep=True).parts()
        shown = [part["variants"] for part in parts]
        click.echo(json.dumps(shown, indent=1) if as_json else variants_table(parts))
        return
    printed: set[str] = set()

    def written(outcome: Outcome) -> None:
        # a fault of the scene is the same in all variants: print it once
        if outcome.error is not None and (fault := without_frame(str(outcome.error))) not in printed:
            printed.add(fault)
            results.fail(f"{outcome.label}: {outcome.error}", _about(outcome))
        report = outcome.report
        if report is None:
            return
        results.add(outcome.paths, lambda: _about(outcome) | report.as_data())
        if quiet:
            return
        say_kept(report.kept)
        for line in repair_lines(report.repairs, verbose):
            if line not in printed:
                say(f"{scene}: {line}")
            printed.add(line)

    results = Results(as_json)
    with results:
        result = sweep_scene(scene, variants, options, files, runner(reporter(quiet)), written)
    for warning in result.warnings:
        say(warning)
    if not quiet:
        say_kept(result.kept)
        if result.summary:
            say(result.summary)


def _about(outcome: Outcome) -> dict[str, Any]:
    """The variant of an outcome for JSON."""
    variant = outcome.variant
    frame = {} if variant.frame is None else {"frame": variant.frame}
    return {"label": outcome.label, "values": dict(variant.values), **frame}
