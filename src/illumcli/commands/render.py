"""Render a scene: load, plan, execute, write one image set per camera."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.cache.fingerprint import digest
from illumcli.cache.store import Store, default_folder, default_limit
from illumcli.errors import InputError
from illumcli.files.names import check_unique, expand
from illumcli.files.outputs import is_kept, refresh
from illumcli.files.reports import sealed_json
from illumcli.film.encode import picture, plain
from illumcli.film.preview import reading, viewable
from illumcli.film.tiles import MOST, Tile
from illumcli.film.view import View
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.repairs import Repairs
from illumcli.images.contents import image_contents
from illumcli.layers import Layer
from illumcli.records import Value
from illumcli.render_graph.cached import Artifacts, Memory
from illumcli.render_graph.culling import unseen_objects, without
from illumcli.render_graph.execute import Planes, RenderStats, bands, run_once
from illumcli.render_graph.framing import framed
from illumcli.render_graph.limits import expected_memory, refuse_disk, refuse_memory
from illumcli.render_graph.proportions import disproportion
from illumcli.render_graph.repairs import refuse_repairs, repairs, repairs_data
from illumcli.render_graph.schedule import Plan, content_key, plan, read_by_others, reusing
from illumcli.scene.load import SceneFile, lacking_lines, load, refuse_outside, told, unused_lines
from illumcli.scene.spec import Scene

BAND_ROWS = math.isqrt(MOST)
"""No band of tiles is higher [pixels]."""
BYTES = {"half": 2, "float": 4, "uint": 4, "uint8": 1, "uint16": 2}
Progress = Callable[[str, int, int], None]
"""Called with what is going on, how much is done and how much there is."""


class Target(Value):
    """One file of an image set and the layers it holds."""

    path: Path
    view: View
    layers: tuple[Layer, ...]
    content: str
    """Hash of all that its pixels depend on."""


@dataclass(slots=True)
class Report:
    """What happened."""

    scene: str
    scene_hash: str
    seed: int
    threads: int
    written: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    skipped: dict[str, str] = field(default_factory=dict)
    repairs: Repairs = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    rays: dict[str, int] = field(default_factory=dict)
    spared: dict[str, int] = field(default_factory=dict)
    """Points that a light does not reach (`incident`) or not freely (`unshadowed`): no ray, no response.
    Polygons of objects that no view can tell. Samples of pixels that adaptive antialiasing leaves at few."""
    refined: int = 0
    """Pixels that adaptive antialiasing gave all samples."""
    reused: dict[str, dict[str, str]] = field(default_factory=dict)
    """Camera -> buffer -> where it was at hand: `memory` or `store`."""
    warnings: list[str] = field(default_factory=list)
    clamped: int = 0
    error: dict[str, float] = field(default_factory=dict)
    """Asked for, reached, and by which counts, where an error was asked for."""
    standard_error: dict[str, dict[str, float]] = field(default_factory=dict)
    """Camera -> mean and root mean square of its layer `error`, where that was rendered."""
    total_seconds: float = 0.0

    def as_data(self) -> dict[str, Any]:
        """The report as JSON has it, with versions and the peak of memory."""
        data = {name: getattr(self, name) for name in self.__slots__} | repairs_data(self.repairs)
        return {"illum": __version__, **data, "peak_memory_bytes": peak_memory(), "versions": versions()}


@dataclass(slots=True)
class ErrorSums:
    """Mean and root mean square of the layer `error`, band by band."""

    pixels: int = 0
    total: float = 0.0
    square: float = 0.0

    def add(self, band: NDArray[np.float32]) -> None:
        """Add the rows of a band."""
        values = band.astype(np.float64)
        self.pixels += values.size
        self.total += float(values.sum())
        self.square += float(np.square(values).sum())

    def as_data(self) -> dict[str, float]:
        """What the report says."""
        return {"mean": self.total / self.pixels, "rms": math.sqrt(self.square / self.pixels)}


class Work(Value):
    """A scene to render: its plan and the files it is to fill."""

    loaded: SceneFile
    scene: Scene
    plan: Plan
    targets: tuple[Target, ...]

    @property
    def content(self) -> str:
        """Hash of all that the pixels of its files depend on."""
        return digest([target.content for target in self.targets])

    def due(self, force: bool) -> list[Target]:
        """The files that are to be written: not those that are there already with the same content.

        Raises
        ------
        OutputError
            A different file is there and `force` is not given; a file cannot be written.
        LimitError
            Memory or disk cannot hold what is due.
        """
        due = [each for each in self.targets if not is_kept(each.path, [each.content], image_contents, force)]
        refuse_too_large(self, due)
        return due


def run(
    path: Path,
    overrides: Sequence[str] = (),
    pattern: str | None = None,
    only: Sequence[str] = (),
    seed: int | None = None,
    threads: int | None = None,
    force: bool = False,
    progress: Progress = lambda what, done, of: None,
    cache: bool = True,
    strict: bool = False,
) -> tuple[list[Path], Report]:
    """Render a scene; the paths of every image, written or kept, and the report.

    With `cache`, what earlier runs kept is used and what later runs may use is kept; the files are the same.
    With `strict`, meshes and textures that need repairs are refused.

    Raises
    ------
    InputError, LimitError, OutputError
        Before anything is rendered, where it can be known then.
    """
    start = time.perf_counter()
    work = prepared(load(path, overrides), pattern, only, seed)
    paths, report = run_prepared(work, pattern, threads, force, progress, cache, strict)
    report.total_seconds = time.perf_counter() - start
    return paths, report


def run_prepared(
    work: Work,
    pattern: str | None = None,
    threads: int | None = None,
    force: bool = False,
    progress: Progress = lambda what, done, of: None,
    cache: bool = True,
    strict: bool = False,
) -> tuple[list[Path], Report]:
    """The same for a scene that was loaded and planned already."""
    start = time.perf_counter()
    store = opened_store() if cache else None
    report = rendered(work, store, Memory(), threads, force, progress, strict)
    report.warnings += unused_keys(work, pattern)
    if store is not None:
        store.finish()
        report.warnings += [store.warning] if store.warning else []
    report.total_seconds = time.perf_counter() - start
    return [target.path for target in work.targets], report


def opened_store() -> Store | None:
    """The store that the user's environment names; None for a user who has no home folder.

    Raises
    ------
    InputError
        ILLUM_CACHE_SIZE says no size.
    """
    folder = default_folder()
    try:
        return Store(folder, default_limit()) if folder is not None else None
    except ValueError as error:
        raise InputError(f"ILLUM_CACHE_SIZE: {error}; write it as 500M or 4G") from None


def prepared(
    loaded: SceneFile,
    pattern: str | None = None,
    only: Sequence[str] = (),
    seed: int | None = None,
    values: Mapping[str, Any] | None = None,
) -> Work:
    """What rendering a scene takes; `values` are more fields of its files' names."""
    scene = loaded.scene if seed is None else loaded.scene.replaced(seed=seed)
    steps = plan(scene, loaded, only)
    patterns = (pattern,) if pattern else scene.outputs.files
    return Work(loaded, scene, steps, tuple(image_set(loaded, scene, steps, patterns, values or {})))


def unused_keys(work: Work, pattern: str | None = None) -> list[str]:
    """What the scene says and what changes nothing, and what its pictures lack, a line each."""
    files = () if pattern else work.scene.outputs.files
    layers = [layer.name for layer in work.plan.layers]
    lacking = lacking_lines(work.loaded, work.scene, layers)
    return lacking + unused_lines(work.loaded, work.scene, layers, files)


def rendered(
    work: Work,
    store: Store | None = None,
    memory: Memory | None = None,
    threads: int | None = None,
    force: bool = False,
    progress: Progress = lambda what, done, of: None,
    strict: bool = False,
    following: Work | None = None,
) -> Report:
    """Render what is due and say what happened.

    `strict` refuses what needs repairs, in all objects, seen or not. In `memory` remains what `following`
    reads.
    """
    start = time.perf_counter()
    threads = threads or len(os.sched_getaffinity(0))
    report = Report(
        str(work.loaded.path), work.content, work.scene.seed, threads, skipped=dict(work.plan.skipped)
    )
    due = work.due(force)
    report.kept = [str(target.path) for target in work.targets if target not in due]
    tally = RenderStats()
    first = Artifacts(store, memory)
    steps = framed(work.plan, first, tally, threads) if due else work.plan
    numbers = unseen_objects(steps, first, tally, threads) if due and not strict else ()
    steps = without(steps, work.loaded, numbers)
    if memory is not None and due:
        after = None
        if following is not None:
            after = framed(following.plan, first, tally, threads)
            after = without(after, following.loaded, numbers)
        memory.wanted = read_by_others(steps, after)
    for view in steps.views:
        mine = [replace(target, view=view) for target in due if target.view.name == view.name]
        if mine:
            artifacts = Artifacts(store, memory, reused=dict(first.reused), made=first.made)
            began = time.perf_counter()
            narrowed = reusing(steps, view, artifacts)
            tally.add({"artifacts": time.perf_counter() - began}, {})
            report.reused[view.name] = dict(narrowed.reused)
            report.skipped = dict(narrowed.skipped)
            shared = run_once(narrowed, tally, artifacts, threads)
            report.repairs = {**report.repairs, **repairs(shared)}
            report.warnings = proportions(work, steps, shared.get("object_bounds"))
            if strict:
                refuse_repairs(report.scene, report.repairs)
            sums = ErrorSums()
            report.clamped += _render_view(
                work.scene, narrowed, shared, view, mine, threads, tally, progress, artifacts, sums
            )
            if sums.pixels:
                report.standard_error[view.name] = sums.as_data()
    report.seconds, report.rays, report.spared = dict(tally.seconds), dict(tally.rays), dict(tally.spared)
    report.refined = tally.refined
    report.written = [str(target.path) for target in due]
    for path in report.kept:
        refresh(Path(path))
    report.total_seconds = time.perf_counter() - start
    return report


def proportions(work: Work, steps: Plan, object_bounds: ObjectBounds | None) -> list[str]:
    """A line where rays that leave surfaces start visibly far off those around some object."""
    if object_bounds is None or all(step.output != "ray_origins" for step in steps.tile):
        return []
    found = disproportion(object_bounds, steps.views)
    if found is None:
        return []
    small, ratio = work.scene.object_names()[found.small], float(f"{found.ratio:.1g}")
    fact = (
        f"reaches {ratio:,.0f} times as far as {small} is large: around {small}, rays start up to "
        f"{found.offset:.1g} off surfaces, {100 * found.share:,.1f} % of its radius, and shadows lose touch; "
        "make it smaller, or bring it nearer"
    )
    return [told(work.loaded, ("objects", found.large), fact)]


def refuse_too_large(work: Work, due: Sequence[Target]) -> None:
    """Raise LimitError where memory or disk cannot hold what is due; nothing has been read or made yet."""
    values = sum(len(layer.channels) for layer in work.plan.layers) + 1
    expected = expected_memory(work.loaded, work.scene) if due else {}
    for target in due:
        view = target.view
        refuse_memory(BAND_ROWS, view.width, values, expected, str(work.loaded.path))
        types = channels(work.scene, target).values()
        refuse_disk(target.path, view.width * view.height * sum(BYTES[kind] for kind in types))


def image_set(
    loaded: SceneFile, scene: Scene, steps: Plan, patterns: Sequence[str], more: Mapping[str, Any]
) -> list[Target]:
    """The files of all views: per `.exr` pattern one with every layer, per `.png` pattern one per layer.

    Where `patterns` are the scene's own, they lead to where it may read; those of the command line anywhere.
    """
    targets = []
    for view in steps.views:
        for number, pattern in enumerate(patterns):
            suffix = Path(pattern).suffix.lower()
            if suffix not in (".exr", ".png"):
                raise InputError(f"output pattern '{pattern}': no image format '{suffix}'; use .exr or .png")
            sets = [steps.layers] if suffix == ".exr" else [(layer,) for layer in steps.layers]
            for layers in sets:
                name = "all" if suffix == ".exr" else layers[0].name
                fields = {"scene": loaded.name, "camera": view.name, "layer": name, "frame": 0}
                path = Path(expand(pattern, {**loaded.overrides, **fields, **more}))
                if patterns is scene.outputs.files:
                    refuse_outside(loaded, number, path)
                targets.append(Target(path, view, tuple(layers), content(scene, steps, view, layers, suffix)))
    check_unique([str(target.path) for target in targets])
    return targets


def content(scene: Scene, steps: Plan, view: View, layers: Sequence[Layer], suffix: str) -> str:
    """Hash of everything that a file's pixels depend on: what its layers are made from, and how it codes
    them."""
    film = scene.film
    coded = (suffix, view.name, [layer.name for layer in layers], scene.outputs.colour)
    shown = (film.background, film.exposure if suffix == ".png" else 0.0)
    buffers = dict.fromkeys([*(layer.buffer for layer in layers), "alpha"])
    return digest((coded, shown, content_key(steps, view, buffers)))


def _render_view(
    scene: Any,
    steps: Plan,
    shared: Mapping[str, Any],
    view: View,
    targets: Sequence[Target],
    threads: int,
    tally: RenderStats,
    progress: Progress,
    artifacts: Artifacts,
    sums: ErrorSums,
) -> int:
    """Write one view's files band by band; how many values were beyond half's range."""
    from illumcli.images.writer import ImageWriter

    frame = shared["render_space"]
    done, pixels = 0, view.width * view.height

    def advance(count: int) -> None:
        nonlocal done
        done += count
        progress(view.name, done, pixels)

    def develop(tile: Tile, layers: Planes) -> dict[str, NDArray[Any]]:
        made = {str(target.path): pixels_of(scene, target, tile, layers, frame) for target in targets}
        return made | ({"error": layers["error"]} if "error" in layers else {})

    with ExitStack() as files:
        writers = [
            files.enter_context(
                ImageWriter(
                    target.path,
                    view.width,
                    view.height,
                    channels(scene, target),
                    metadata(scene, target, frame),
                    srgb=target.layers[0].kind == "light",
                )
            )
            for target in targets
        ]
        for band in bands(steps, shared, view, threads, tally, advance, None, artifacts, develop):
            start = time.perf_counter()
            if "error" in band.layers:
                sums.add(band.layers["error"])
            for target, writer in zip(targets, writers, strict=True):
                writer.write_band(band.y, band.layers[str(target.path)])
            tally.add({"write": time.perf_counter() - start}, {})
        start = time.perf_counter()
        clamped = sum(writer.close().clamped for writer in writers)
        tally.add({"write": time.perf_counter() - start}, {})
    return clamped


def channels(scene: Any, target: Target) -> dict[str, Any]:
    """Channel name -> type of a file; the beauty's R G B A come first."""
    from illumcli.images.channels import channel_types

    if target.path.suffix.lower() == ".png":
        layer = target.layers[0]
        names = ("Y",) if len(layer.channels) == 1 and layer.kind != "id" else tuple("RGB")
        has_alpha = layer.buffer == "beauty" and scene.film.background is None
        return dict.fromkeys((*names, "A") if has_alpha else names, "uint8")
    names = tuple(name for layer in _beauty_first(target.layers) for name in _channels(scene, layer))
    types = dict(channel_types(tuple(dict.fromkeys(names)), scene.outputs.colour))
    return types | {name: "uint" for layer in target.layers if layer.kind == "id" for name in layer.channels}


def _beauty_first(layers: Sequence[Layer]) -> list[Layer]:
    return sorted(layers, key=lambda layer: layer.buffer != "beauty")


def _channels(scene: Any, layer: Layer) -> tuple[str, ...]:
    return (
        (*layer.channels, "A")
        if layer.buffer == "beauty" and scene.film.background is None
        else layer.channels
    )


def pixels_of(scene: Any, target: Target, tile: Tile, layers: Planes, frame: Any) -> NDArray[Any]:
    """(rows, columns, channels) of one file's tile, as its writer takes them."""
    from illumcli.images.channels import bits_of

    parts = {layer.name: composed(scene, layer, layers) for layer in target.layers}
    if target.path.suffix.lower() == ".png":
        layer = target.layers[0]
        if layer.kind == "light":
            return picture(parts[layer.name], scene.film.exposure, 8, str(target.path), tile.y, tile.x)
        shown = viewable(layer, parts[layer.name], preview_scale(target, frame), frame.centre)
        return plain(shown, str(target.path), tile.y, tile.x)
    seen: dict[str, NDArray[np.float32]] = {}
    for layer in _beauty_first(target.layers):
        values = bits_of(parts[layer.name]) if layer.kind == "id" else parts[layer.name]
        for k, name in enumerate(_channels(scene, layer)):
            seen.setdefault(name, values[..., k])
    return np.stack(list(seen.values()), axis=-1)


def preview_scale(target: Target, frame: Any) -> float:
    """What pictures count distances in [scene units]: the scene's radius for positions, the way from the
    camera to its target for depths."""
    if target.layers[0].preview == "position":
        return float(frame.radius)
    camera = target.view.camera
    return float(np.linalg.norm(np.subtract(camera.target, camera.position)))


def composed(scene: Any, layer: Layer, layers: Planes) -> NDArray[Any]:
    """The layer's pixels; the beauty over its background, or with its alpha where there is none."""
    values = layers[layer.name]
    if layer.buffer != "beauty":
        return values
    alpha = layers["alpha"]
    if scene.film.background is None:
        return np.concatenate([values, alpha], axis=-1)
    background = np.asarray(scene.film.background, np.float32)
    behind = background[:, None, None] * (1 - alpha[..., 0])  # channel by channel, as layers are kept
    return values + np.moveaxis(behind, 0, -1)


def metadata(scene: Any, target: Target, frame: Any) -> dict[str, Any]:
    """What a file says of itself."""
    view = target.view
    if target.path.suffix.lower() == ".exr":
        values = {"illum:depth": "distance from the eye's plane in scene units, 0 where nothing is seen"}
    elif target.layers[0].kind != "light":
        values = reading(target.layers[0], preview_scale(target, frame), frame.centre)
    else:
        values = {}
    return {
        "Software": f"illum {__version__}",
        "illum:version": __version__,
        "illum:content": target.content,
        "illum:camera": view.name,
        "illum:layers": ",".join(layer.name for layer in target.layers),
        "illum:samples": view.samples,
        "illum:seed": str(scene.seed),
        "illum:exposure": scene.film.exposure,
        "illum:obscurance_samples": scene.obscurance.samples if scene.obscurance else 0,
        **values,
    }


def peak_memory() -> int:
    """Largest resident size of this process so far [bytes]."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def versions() -> dict[str, str]:
    """Versions of what a picture depends on."""
    from importlib.metadata import version

    names = ("numpy", "embreex", "OpenImageIO", "pydantic")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


def report_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """One entry, or a list of several, as JSON; each says its `content`, the first the file's hash."""
    return sealed_json(entries, in_a_list=len(entries) > 1)
