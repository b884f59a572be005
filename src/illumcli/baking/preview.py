"""The preview of a bake: the asset from four sides, w alone and in light, with a histogram and its error."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.baking.files import baked_about
from illumcli.baking.ground import Ground
from illumcli.baking.inputs import BakeWork
from illumcli.baking.report import BakeReport
from illumcli.cache.fingerprint import digest
from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.errors import InputError
from illumcli.files.outputs import is_kept, refresh, refuse_suffix
from illumcli.film.encode import picture
from illumcli.geometry.scene_geometry import SceneGeometry, triangle_corners
from illumcli.graph import topological_order
from illumcli.images.contact_sheet import write_contact_sheet
from illumcli.images.contents import image_contents
from illumcli.images.histogram import histogram_picture, text_picture
from illumcli.images.sheet_layout import Sheet
from illumcli.mesh_files import is_mesh_file
from illumcli.mesh_files.obj import GREY
from illumcli.rays.corner_weights import TriangleCorners
from illumcli.records import Record
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile

AZIMUTHS = (24, 114, 204, 294)
"""Of the views [degrees]."""
ELEVATION = 13
SIZE = 320
"""Side of each picture [pixels]."""
SURFACE_POINTS = 1 << 16
"""Points on the surface, of equal area, that the histogram counts, about."""


class SideView(Record):
    """A view of the asset."""

    w: NDArray[np.uint8]  # (SIZE, SIZE, 3) display values of plain w
    light: NDArray[np.uint8]  # (SIZE, SIZE, 3) display values of the beauty


def refuse_preview(work: BakeWork) -> None:
    """Raise an error if the preview of a bake cannot be made, or another file has its name.

    Raises
    ------
    InputError
        It is no PNG; no obscurance is baked; the outputs cannot be shown.
    OutputError
        A different file exists.
    """
    path = _preview(work)
    refuse_suffix(path, "a preview", ".png")
    if "ao" not in work.settings.what:
        raise InputError(f"{path}: a preview shows ao; add it to --what")
    if (what := _not_shown(work)) is not None:
        raise InputError(f"{path}: a preview shows no {what}; add a .glb or .ply with -o")
    is_kept(path, [_content(work)], image_contents, work.job.options.force)


def with_preview(work: BakeWork, paths: list[Path], report: BakeReport) -> tuple[list[Path], BakeReport]:
    """The files and the report of a bake with its preview, which is written unless it exists."""
    path = _preview(work)
    if is_kept(path, [_content(work)], image_contents, work.job.options.force):
        refresh(path)
        return [*paths, path], replace(report, kept=[*report.kept, str(path)])
    write_preview(path, work)
    work.clock.lap("preview")
    seconds = dict(work.clock.seconds)
    return [*paths, path], replace(report, written=[*report.written, str(path)], seconds=seconds)


def _preview(work: BakeWork) -> Path:
    assert work.job.preview is not None
    return work.job.preview


def _shown(work: BakeWork) -> Path:
    """The output that the preview shows: the first mesh with its values, or the first output with w."""
    with_w = [
        each for each in work.outputs if each not in work.texture_of or "ao" in work.texture_of[each].what
    ]
    return next((each for each in with_w if _is_asset(work, each)), with_w[0])


def _is_asset(work: BakeWork, path: Path) -> bool:
    """True for a mesh file from which w can be read: no OBJ that has it in some channel of its colours."""
    return is_mesh_file(path) and (path.suffix.lower() != ".obj" or work.settings.color in GREY)


def _not_shown(work: BakeWork) -> str | None:
    """What the outputs are, if no preview can show them on the input."""
    shown = _shown(work)
    if _is_asset(work, shown):
        return None
    if is_mesh_file(shown):
        return "OBJ with --color"
    if not is_mesh_file(work.path):
        return "scene without its mesh"
    if shown.suffix.lower() == ".npz":
        return None
    has_uv = all(placed.mesh.uvs is not None for placed in work.surfaces.geometry.placed)
    if work.settings.unwrap == "all" or not has_uv:
        return "texture over uv that the bake makes"
    return "several textures without their mesh" if len(work.slots) > 1 else None


def _content(work: BakeWork) -> str:
    """Hash of everything that the preview depends on."""
    return digest(("preview", work.content, _shown(work).suffix.lower()))


def write_preview(path: Path, work: BakeWork) -> None:
    """Write the preview of a bake whose files exist."""
    shown = _shown(work)
    run = Run(RenderStats(), Cache(None, MemoryCache()), work.job.threads)
    views = [_side_view(_scene_of(work, shown, azimuth), run) for azimuth in AZIMUTHS]
    w, area = _over_the_surface(_scene_of(work, shown, AZIMUTHS[0]))
    cells = [*(view.w for view in views), histogram_picture(SIZE, w, area, "share of the surface by w")]
    cells += [*(view.light for view in views), text_picture(SIZE, _facts(work, baked_about(shown), w, area))]
    count = len(cells) // 2
    sheet = Sheet(
        (tuple(range(count)), tuple(range(count, 2 * count))),
        column_heads=(*(f"azimuth {azimuth}" for azimuth in AZIMUTHS), work.path.name),
        row_heads=("w", "light"),
    )
    pictures = [lambda pixels=pixels: pixels for pixels in cells]
    write_contact_sheet(path, sheet, pictures, [(SIZE, SIZE)] * len(cells), _content(work))


def _scene_of(work: BakeWork, shown: Path, azimuth: int) -> SceneFile:
    """The studio's scene with the baked asset, without a floor."""
    overrides = [
        f"film={{width: {SIZE}, height: {SIZE}, samples: 4, background: [0.6, 0.62, 0.66]}}",
        f"studio.view=[{azimuth}, {ELEVATION}]",
        f"studio.up={Ground.of(work.settings.ground or 'y').up}",
        "objects.floor=null",
    ]
    if is_mesh_file(shown):
        return load(shown, overrides)
    values = json.dumps(str(shown.absolute()))
    loaded = load(work.path, [*overrides, f"meshes.subject.obscurance={values}"])
    return replace(loaded, roots=(*loaded.roots, shown.absolute().parent))


def _side_view(loaded: SceneFile, run: Run) -> SideView:
    """The pictures of one view."""
    outputs = outputs_of(loaded.scene, ("obscurance", "beauty", "alpha"))
    graph = place_and_cull(build(loaded.scene, loaded), outputs, run)
    plan = plan_view(graph, outputs, graph.views[0], run.cache)
    rows = list(bands(plan, run_once(plan, run), run))
    w, light, alpha = (
        np.concatenate([row.layers[name] for row in rows]) for name in ("obscurance", "beauty", "alpha")
    )
    background = np.asarray(loaded.scene.film.background, np.float32)
    behind = (1 - alpha) * background
    plain = np.rint(255 * np.clip(w + behind, 0, 1)).astype(np.uint8)
    return SideView(plain, picture(light + behind))


def _over_the_surface(loaded: SceneFile) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """w at points on the surface, and the area that each point represents."""
    nodes = build(loaded.scene, loaded).nodes
    buffers: dict[str, Any] = {}
    for node in topological_order(nodes, ["geometry"]):
        buffers[node.output] = node.run(buffers)
    buffers["hits"], area = _surface_points(buffers["geometry"])
    for node in topological_order(nodes, ["baked_obscurance"], buffers):
        buffers[node.output] = node.run(buffers)
    return buffers["baked_obscurance"], area


def _surface_points(geometry: SceneGeometry) -> tuple[TriangleCorners, NDArray[np.float64]]:
    """Points spread over all triangles in proportion to their area, and the area that each represents."""
    a, b, c = triangle_corners(geometry.vertices, geometry.triangles)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    end = np.cumsum(area, dtype=np.float64)
    at = (np.arange(SURFACE_POINTS) + 0.5) / SURFACE_POINTS * end[-1]
    triangle = np.searchsorted(end, at).astype(np.int32)
    rng = np.random.default_rng(0)
    u, v = rng.random((2, SURFACE_POINTS), np.float32)
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    objects = geometry.objects.take(triangle)
    return TriangleCorners(None, objects, triangle, u, v), np.full(SURFACE_POINTS, end[-1] / SURFACE_POINTS)


def _facts(
    work: BakeWork, about: Mapping[str, Any], w: NDArray[np.float32], area: NDArray[np.float64]
) -> Sequence[str]:
    """Lines about the values and how they were computed."""
    settings, sampled = work.settings, about["sampled"]["obscurance"]
    of_both = settings.texture is not None and is_mesh_file(_shown(work))
    at = ", at vertices" if of_both else ""
    where = f"method: {settings.method}"
    if settings.texture is not None and not is_mesh_file(_shown(work)):
        where = "texture: {} x {}".format(*settings.texture)
    rays = f"{settings.samples} rays per point"
    if settings.target_error is not None:
        rays = f"for an error of {settings.target_error:g}"
    return [
        f"error {sampled['rmse']:.2g} (root mean square{at})",
        f"{sampled['rays']:,} rays, {rays}",
        f"{len(work.surfaces.geometry.vertices):,} vertices, "
        f"{len(work.surfaces.geometry.triangles):,} triangles",
        "",
        f"mean {np.average(w, weights=area):.3f}, from {w.min():.3f} to {w.max():.3f}",
        *(f"{name}: {value}" for name, value in settings.falloff.items()),
        f"back faces: {settings.faces}",
        f"{where}, seed {settings.seed}",
        *([f"ground: {settings.ground}"] if settings.ground else []),
    ]
