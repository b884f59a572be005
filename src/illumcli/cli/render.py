"""``illum render``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from illumcli.cli._options import (
    RunnerOf,
    cluster_options,
    force_option,
    frames_option,
    gathered,
    html_option,
    json_results_option,
    keep_going_option,
    models_words,
    no_cache_option,
    only_option,
    overrides_option,
    pattern_option,
    quiet_option,
    render_options,
    report_option,
    scenes_argument,
    seed_option,
    shard_option,
    strict_option,
    studio_options,
    taken,
    threads_option,
    verbose_option,
)
from illumcli.cli._printing import Results, run_batch, say, say_kept

if TYPE_CHECKING:
    from illumcli.commands.options import RenderFiles, RenderOptions
    from illumcli.commands.render_all import Rendered


def _files(options: dict[str, Any]) -> RenderFiles:
    from illumcli.commands.options import RenderFiles

    if options["html"] is not None and options["shard"] is not None:
        way = "render with it and without --shard after illum merge: pictures that exist are kept"
        raise click.UsageError(f"--html shows all scenes, --shard renders some of them; {way}")
    return taken(RenderFiles, options)


@click.command()
@scenes_argument
@pattern_option
@overrides_option
@studio_options
@frames_option
@only_option
@click.option(
    "--target-error",
    type=click.FloatRange(0, min_open=True),
    metavar="E",
    help="Choose sample counts that reach this RMSE, using pilot renders with separate seeds.",
)
@seed_option("Random seed; by default the scene's.")
@threads_option
@report_option
@html_option
@json_results_option
@force_option()
@keep_going_option
@cluster_options
@strict_option
@no_cache_option
@shard_option
@quiet_option
@verbose_option
@gathered("about_all", _files)
@gathered("options", render_options)
def render(
    scenes: tuple[Path, ...],
    options: RenderOptions,
    about_all: RenderFiles,
    runner: RunnerOf,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Render each SCENE, a scene file or a mesh; print the path of every image.

    \b
    A pattern may hold {scene}, {camera}, {layer}, {frame} and any overridden path:
      illum render scenes/teapot.yaml -o out/{scene}.{camera}.exr
      illum render scene.yaml -D materials.clay.sigma=0.3 -o 'clay-{materials.clay.sigma}.png'
      illum render scene.yaml --only normal --only depth -o '{scene}.{layer}.png'
    A mesh stands on a floor under two lights:
      illum render bunny.obj
    Frames of a film, and a film of any scene:
      illum render scenes/film.yaml --frames 0:47:12
      illum render scene.yaml --frames 0:47 -D 'ambient=frame/47' -o 'film/{frame:04d}.png'
    """
    from illumcli.cli._progress import reporter

    said: set[str] = set()
    films: dict[Path, list[Rendered]] = {}

    def say_once(line: str) -> None:
        # what is said of a scene is the same at most of its frames
        if line not in said:
            say(line)
        said.add(line)

    def written(done: Rendered) -> None:
        if done.report.chosen and not quiet:
            error = done.report.error
            reached = f"for an error of {error['target']:g}; reached {error['reached']:.3g}"
            say(f"{done.scene}: {' '.join(done.report.chosen)}, {reached}")
        results.add(done.paths, lambda: _entry(done))
        _say_report(done, quiet, verbose, say_once)
        if done.frame is not None and len(film := films.setdefault(done.scene, [])) < 2:
            film.append(done)

    do: Callable[..., list[Path] | str]
    if options.shard is None:
        from illumcli.commands.render_all import render_scenes as do
    else:
        from illumcli.commands.render_shard import render_shard as do

    results = Results(as_json)
    given = scenes, options, about_all, runner(reporter(quiet)), written, results.fail
    run_batch(results, lambda: do(*given), quiet)
    if options.shard is None and not quiet and sys.stderr.isatty():
        _say_films(films)


def _entry(done: Rendered) -> dict[str, Any]:
    """A rendered scene or frame for JSON."""
    frame = {} if done.frame is None else {"frame": done.frame}
    return {**frame, **done.report.as_data()}


def _say_films(films: Mapping[Path, Sequence[Rendered]]) -> None:
    """Print how to make a film of the frames of each scene."""
    from illumcli.commands.film_command import film_command

    for frames in films.values():
        numbered = [(done.frame, done.paths[0]) for done in frames if done.frame is not None]
        if command := film_command(numbered, frames[0].fps):
            say(f"for a film: {command}")


def _say_report(done: Rendered, quiet: bool, verbose: bool, say_once: Callable[[str], None]) -> None:
    """Print the report of a scene or frame."""
    import shlex

    from illumcli.render_graph.repairs import repair_lines

    report = done.report
    if not quiet:
        say_kept(report.kept)
        for line in repair_lines(report.repairs, verbose):
            say_once(f"{done.scene}: {line}")
        for name, count in report.mended.items():
            fact = f"{count} values of its model were negative or not finite, and are 0"
            check = shlex.join(["illum", "verify", str(done.scene), *models_words()])
            say_once(f"{done.scene}: material {name}: {fact}; see {check}")
        for camera, error in report.audited_error.items():
            interval = f"(95 %: {error['low']:.3g} to {error['high']:.3g})"
            say(f"{done.scene}: RMSE of {error['layer']} of {camera}: {error['rmse']:.3g} {interval}")
    for warning in report.warnings:
        say_once(warning)
    if not verbose:
        return

    # Clamped values, errors, reused and skipped buffers, rays and times.
    if report.clamped:
        fact = f"{report.clamped} values beyond 65504, the largest of half precision, are written as that"
        say(f"{done.scene}: {fact}; outputs.colour: float keeps them")
    for name, file in report.obscurance_files.items():
        say(f"{done.scene}: {name}: obscurance from {file}, 0 rays")
    for camera, reused in report.reused.items():
        for name, where in reused.items():
            say(f"reused {name} of {camera}: from the {where}")
    for name, why in report.skipped.items():
        say(f"skipped {name}: {why}")
    if report.ray_loop:
        say(f"rays: {report.ray_loop}")
    for name, seconds in sorted(report.seconds.items(), key=lambda item: -item[1]):
        say(f"{seconds:8.3f} s {report.rays.get(name, 0):12d} rays  {name}")
