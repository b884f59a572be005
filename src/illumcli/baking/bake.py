"""Bake obscurance at every vertex of a mesh or a scene, with its error, into files of its meshes."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.arrays import F, column_major, cross, take_rows, unit
from illumcli.baking.files import SUFFIXES, add_baked_to_glb, baked_contents, write_baked_glb, write_baked_ply
from illumcli.baking.outputs import shapes_of
from illumcli.baking.points import Surfaces, Vertices, vertex_points
from illumcli.baking.sampling import MOST_SAMPLES, BakeSampler, Occluders
from illumcli.baking.values import baked_values
from illumcli.cache.fingerprint import digest
from illumcli.commands.render import peak_memory
from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import is_full
from illumcli.files.journal import Journal, place, tidy
from illumcli.files.outputs import is_kept, refresh
from illumcli.geometry.repairs import Repairs
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.graph import topological_order
from illumcli.mesh_files.output_mesh import OutputMesh
from illumcli.rays.embree import Tracer
from illumcli.records import Record, Value
from illumcli.render_graph import stages
from illumcli.render_graph.build import recipes
from illumcli.render_graph.keys import code
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.render_graph.repairs import refuse_repairs, repairs_data
from illumcli.scene.load import MESH_SUFFIXES, SceneFile, load
from illumcli.scene.spec import Obscurance, Scene
from illumcli.visibility.baked import Baked, mesh_hash, write_npz
from illumcli.visibility.obscurance import Method
from illumcli.visibility.open_hemisphere import ClusterTree

Progress = Callable[[str, int, int], None]

GROUND_GAP = 1e-4
"""How far the added ground lies below the lowest point, in radii: what stands on it is closed below."""
GROUND_SIZE = 1e3
DARK, MOSTLY = 0.01, 0.9
"""Where a larger share of the values is lower, the mesh is taken to be turned inside out."""


class Settings(Value):
    """What a bake is asked for."""

    samples: int = 256
    target_error: float | None = None
    falloff: Mapping[str, Any] = field(default_factory=lambda: {"falloff": "step"})
    sampler: str = "spiral"
    faces: str = "count"
    method: str = "vertex"  # or `fit`
    occluders: tuple[str, ...] = ("scene",)  # or `own`, or names of objects
    ground: str | None = None  # up axis
    bent_normal: bool = False
    channel: str | None = None
    split: bool = False  # vertices of a PLY
    seed: int = 0

    def obscurance(self) -> Obscurance:
        """The same as a scene has it."""
        return Obscurance.validated(
            {
                "samples": self.samples,
                "falloff": dict(self.falloff),
                "sampler": self.sampler,
                "faces": self.faces,
            }
        )


@dataclass(slots=True)
class Report:
    """What happened."""

    input: str
    content: str
    seed: int
    threads: int
    vertices: int = 0
    triangles: int = 0
    unreferenced: int = 0
    without_normal: int = 0
    copies: int = 0
    open: int = 0  # points with nothing above their tangent plane: no ray
    cast: int = 0  # points that cast rays
    rmse: float = 0.0  # root mean square error over all vertices
    target_error: float | None = None
    rays: dict[str, int] = field(default_factory=dict)
    resumed: int = 0  # of these, those that an earlier run cast
    samples: dict[int, int] = field(default_factory=dict)  # rays a point -> points
    repairs: Repairs = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    written: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)

    def as_data(self) -> dict[str, Any]:
        """The report as JSON has it."""
        data = {name: getattr(self, name) for name in self.__slots__} | repairs_data(self.repairs)
        return {"illum": __version__, **data, "peak_memory_bytes": peak_memory()}

    def summary(self) -> str:
        """One line: how right it is and what it took."""
        rays = sum(self.rays.values())
        return (
            f"{self.vertices} vertices: error {self.rmse:.2g} (root mean square), {rays} rays, "
            f"{self.open} points open without a ray"
        )


def run(
    path: Path,
    outputs: Sequence[Path],
    settings: Settings,
    overrides: Sequence[str] = (),
    threads: int | None = None,
    force: bool = False,
    progress: Progress = lambda what, done, of: None,
    strict: bool = False,
) -> tuple[list[Path], Report]:
    """Bake a mesh file, or every mesh of a scene in its place; the files, written or kept, and the report.

    Raises
    ------
    InputError, OutputError
        Before anything is baked, where it can be known then.
    """
    work = prepared(path, outputs, settings, overrides, force, strict)
    return baked(work, settings, threads, progress)


class Work(Record):
    """A bake whose meshes were read: what it is about and the files that are due."""

    path: Path
    outputs: tuple[Path, ...]
    due: tuple[Path, ...]
    scene: Scene
    surfaces: Surfaces
    hashes: tuple[str, ...]
    """Of the meshes."""
    content: str
    repairs: Repairs
    clock: _Clock


def prepared(
    path: Path,
    outputs: Sequence[Path],
    settings: Settings,
    overrides: Sequence[str] = (),
    force: bool = False,
    strict: bool = False,
) -> Work:
    """What a bake takes, after looking at all that could stand against it; no ray is cast."""
    check_outputs(outputs)
    if settings.split and not any(each.suffix.lower() == ".ply" for each in outputs):
        raise InputError("--split belongs to .ply outputs; .glb is split where it must be, .npz has corners")
    clock = _Clock()
    loaded = bare(path, overrides) if path.suffix.lower() in MESH_SUFFIXES else load(path, overrides)
    expected = expected_memory(loaded, loaded.scene)
    expected.pop("textures", None)  # no bake reads them
    refuse_memory(0, 0, 0, expected, str(path))
    surfaces, repairs = surfaces_of(loaded.scene, loaded)
    meshes = [placed.mesh for placed in surfaces.world.placed]
    hashes = tuple(mesh_hash(mesh.vertices, mesh.corners, mesh.starts) for mesh in meshes)
    content = content_hash(loaded.scene, hashes, surfaces.normals, settings)
    if strict:
        refuse_repairs(str(path), repairs)
    due = tuple(each for each in outputs if not is_kept(each, [content], baked_contents, force))
    return Work(path, tuple(outputs), due, loaded.scene, surfaces, hashes, content, repairs, clock)


def baked(
    work: Work,
    settings: Settings,
    threads: int | None = None,
    progress: Progress = lambda what, done, of: None,
) -> tuple[list[Path], Report]:
    """The files of a bake, written or kept, and the report."""
    scene, world, due, clock = work.scene, work.surfaces.world, work.due, work.clock
    threads = threads or len(os.sched_getaffinity(0))
    report = Report(str(work.path), work.content, settings.seed, threads, target_error=settings.target_error)
    report.vertices, report.triangles = len(world.vertices), len(world.triangles)
    report.repairs = work.repairs
    report.kept = [str(each) for each in work.outputs if each not in due]
    for each in report.kept:
        refresh(Path(each))
    clock.lap(report, "read")
    if due:
        # a journal is of one computation, on processors with the same instructions
        journal = Journal(place(work.outputs[0], work.content), digest((work.content, code())))
        try:
            values = bake(scene, work.surfaces, settings, threads, progress, report, journal, clock)
            if journal.refusal is not None:
                report.warnings.append(
                    f"finished pieces are not kept beside {work.outputs[0]} for a next run: {journal.refusal}"
                )
            values = replace(values, about=_about(work, settings, report))
            write_all = partial(write, work.path, due, scene, world, values, settings, report)
            try:
                write_all()
            except OutputError as error:
                if not is_full(error):
                    raise
                journal.remove()  # the journal fills the disk, too, and the values are at hand
                write_all()
            journal.remove()
        finally:
            journal.close()
        clock.lap(report, "write")
    tidy(work.outputs[0])
    report.written = [str(each) for each in due]
    return list(work.outputs), report


def _about(work: Work, settings: Settings, report: Report) -> dict[str, Any]:
    """What the files of a bake say of themselves."""
    names, placed = work.scene.object_names(), work.surfaces.world.placed
    return {
        "content": work.content,
        "version": __version__,
        "input": work.path.name,
        "meshes": dict(zip(names, work.hashes, strict=True)),
        "vertices": {name: len(each.mesh.vertices) for name, each in zip(names, placed, strict=True)},
        "corners": {name: len(each.mesh.corners) for name, each in zip(names, placed, strict=True)},
        "parameters": parameters(settings),
        "seed": settings.seed,
        "rmse": report.rmse,
        "rays": sum(report.rays.values()),
    }


def surfaces_of(scene: Scene, loaded: SceneFile) -> tuple[Surfaces, Repairs]:
    """The scene's meshes in their places, made as a render makes them, and the normals that w is taken about;
    what was put right."""
    buffers: dict[str, Any] = {}
    for step in topological_order(recipes(scene, loaded), ["world", "corner_normals", "repairs"]):
        buffers[step.output] = step.run(buffers)
    world, normals = buffers["world"], buffers["corner_normals"]
    if scene.obscurance is not None and scene.obscurance.about == "geometric":
        normals = stages.corner_normals(("flat",) * len(world.placed), buffers["meshes"], world)
    return Surfaces(world, normals), buffers["repairs"].repairs


def check_outputs(outputs: Sequence[Path]) -> None:
    """Refuse suffixes nobody writes and files named twice."""
    problems = [
        f"{each}: no writer for '{each.suffix}' files; use one of {', '.join(SUFFIXES)}"
        for each in outputs
        if each.suffix.lower() not in SUFFIXES
    ]
    if len({os.path.abspath(each) for each in outputs}) < len(outputs):
        problems.append("an output is named twice; give each file once")
    if problems:
        raise InputError(problems)


def bare(path: Path, overrides: Sequence[str]) -> SceneFile:
    """A scene of one mesh file alone, as it stands."""
    found = load(path, overrides)
    about = {"version": 1, "objects": [{"mesh": {"file": path.name}, "name": "mesh"}]}
    return replace(found, scene=Scene.validated(about))


def parameters(settings: Settings) -> dict[str, Any]:
    """What a value depends on besides the scene, as JSON has it."""
    return {**vars(settings), "falloff": dict(settings.falloff), "occluders": list(settings.occluders)}


def content_hash(scene: Scene, hashes: Sequence[str], normals: CornerVectors, settings: Settings) -> str:
    """Of all that the values and the files depend on."""
    placed = [dict(thing.transform) for thing in scene.objects]
    text = json.dumps(
        [__version__, parameters(settings), list(hashes), placed, scene.object_names()], default=str
    )
    digest = hashlib.blake2b(text.encode(), digest_size=16)
    for array in (normals.values, normals.index):
        digest.update(np.ascontiguousarray(array.T).data)
    return digest.hexdigest()


def bake(
    scene: Scene,
    surfaces: Surfaces,
    settings: Settings,
    threads: int,
    progress: Progress,
    report: Report,
    journal: Journal,
    clock: _Clock,
) -> Baked:
    """Obscurance of every vertex of the world."""
    world = surfaces.world
    occluders = occluders_of(scene, world, settings)
    wanted = settings.obscurance()
    method = Method(settings.samples, wanted.falloff, world.frame.radius, wanted.sampler, wanted.faces)
    clock.lap(report, "build")
    if settings.method == "fit":
        from illumcli.baking.fit import fitted

        made = fitted(surfaces, occluders, method, settings.seed, threads, progress, report.rays)
        say_vertices(report, made.vertices)
        report.open, report.cast, report.samples = made.open, made.points, {settings.samples: made.points}
        report.rmse = (
            float(np.sqrt(np.mean(np.square(made.error, dtype=np.float64)))) if len(made.error) else 0.0
        )
        say_dark(report, made.w)
        clock.lap(report, "cast")
        return baked_values(made.vertices, made.w, made.error, None)
    vertices = vertex_points(surfaces)
    caster = BakeSampler(vertices.points, occluders, method, settings.seed, threads, progress)
    say_vertices(report, vertices)
    clock.lap(report, "points")
    is_open = caster.open()
    lanes = np.flatnonzero(~is_open)
    report.open, report.cast = int(is_open.sum()), len(lanes)
    clock.lap(report, "horizon")
    share = len(lanes) / max(len(is_open), 1)
    if settings.target_error is None:
        samples = np.full(len(lanes), settings.samples)
    else:
        samples = caster.samples_for(lanes, share, settings.target_error)
        clock.lap(report, "pilot")
    found = caster.cast("values", lanes, samples, 0, settings.bent_normal, journal)
    report.resumed = caster.resumed
    clock.lap(report, "cast")
    errors = caster.errors(lanes, samples, 1 << 20)
    clock.lap(report, "errors")
    report.rmse = errors.rmse * share**0.5
    if settings.target_error is not None and report.rmse > settings.target_error:
        report.warnings.append(
            f"error {report.rmse:.2g} is above the {settings.target_error:g} asked for: no vertex casts more "
            f"than {MOST_SAMPLES} rays"
        )
    report.rays = dict(caster.rays)
    count, points = np.unique(samples, return_counts=True)
    report.samples = dict(zip(count.tolist(), points.tolist(), strict=True))
    w, error = np.ones(len(is_open), F), np.zeros(len(is_open), F)
    w[lanes], error[lanes] = found.w, errors.at(found.neighbor_variation, samples)
    bent = None
    if found.bent is not None:
        bent = vertices.points.n.copy()
        bent[lanes] = found.bent
    say_dark(report, w)
    return baked_values(vertices, w, error, bent)


def say_vertices(report: Report, vertices: Vertices) -> None:
    """Count what became of the vertices."""
    report.unreferenced, report.without_normal = vertices.unreferenced, vertices.without_normal
    report.copies = vertices.copies


def say_dark(report: Report, w: NDArray[np.float32]) -> None:
    """Warn where next to nothing is open, as in a mesh that is turned inside out."""
    dark = float(np.mean(w < DARK)) if len(w) else 0.0
    if dark > MOSTLY:
        report.warnings.append(
            f"{dark:.0%} of the values are 0: the polygons seem to face inwards; turn their winding around, "
            "or give the file outward normals"
        )


def occluders_of(scene: Scene, world: SceneGeometry, settings: Settings) -> list[Occluders]:
    """What hides the vertices of each object: the scene, the object itself, or it and objects by name."""
    names = scene.object_names()
    if "own" in settings.occluders and "own" in names:
        raise InputError("--occluders own: an object has that name too; give the object another name")
    unknown = [name for name in settings.occluders if name not in (*names, "scene", "own")]
    if unknown:
        raise InputError(
            f"--occluders {unknown[0]}: no object of that name; there are: scene, own, {', '.join(names)}"
        )
    known: dict[tuple[int, ...], Occluders] = {}
    found = []
    for number in range(len(names)):
        if "scene" in settings.occluders:
            things = tuple(range(len(names)))
        else:
            things = tuple(sorted({number, *(names.index(n) for n in settings.occluders if n in names)}))
        if things not in known:
            known[things] = _occluders(world, things, settings)
        found.append(known[things])
    return found


def _occluders(world: SceneGeometry, things: tuple[int, ...], settings: Settings) -> Occluders:
    triangles = world.triangles
    if len(things) < len(world.placed):
        triangles = triangles[np.isin(world.objects, things)]
    vertices = world.vertices
    if settings.ground is not None:
        vertices, triangles = _with_ground(vertices, triangles, world.triangles, "xyz".index(settings.ground))
    facets = None
    if settings.faces != "count":
        corner = [column_major(take_rows(vertices, triangles[:, k]), np.float64) for k in range(3)]
        facets = column_major(unit(cross(corner[1] - corner[0], corner[2] - corner[0])), F)
    return Occluders(Tracer(vertices, triangles), ClusterTree(vertices, triangles), facets)


def _with_ground(
    vertices: NDArray[np.float32], triangles: NDArray[np.int32], used: NDArray[np.int32], up: int
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A large square under everything, facing up."""
    level = vertices[np.unique(used), up].min(initial=0) - GROUND_GAP
    a, b = (up + 1) % 3, (up + 2) % 3
    square = np.empty((4, 3), F)
    square[:, up] = level
    square[:, a], square[:, b] = [-GROUND_SIZE, GROUND_SIZE, GROUND_SIZE, -GROUND_SIZE], [
        -GROUND_SIZE, -GROUND_SIZE, GROUND_SIZE, GROUND_SIZE
    ]  # fmt: skip
    first = len(vertices)
    faces = np.array([[first, first + 1, first + 2], [first, first + 2, first + 3]], np.int32)
    return np.concatenate([vertices, square]), np.concatenate([triangles, faces])


def write(
    path: Path,
    outputs: Sequence[Path],
    scene: Scene,
    world: SceneGeometry,
    baked: Baked,
    settings: Settings,
    report: Report,
) -> None:
    """All files of a bake."""
    alone = path.suffix.lower() if path.suffix.lower() in MESH_SUFFIXES else ""
    made: dict[bool, tuple[list[OutputMesh], Baked]] = {}

    def shapes(divided: bool) -> tuple[list[OutputMesh], Baked]:
        if divided not in made:
            made[divided] = shapes_of(scene.object_names(), world, baked, divided, report.left_out)
        return made[divided]

    for each in outputs:
        kind = each.suffix.lower()
        if kind == ".npz":
            write_npz(each, baked)
        elif kind == ".ply" and alone == ".ply" and not settings.split:
            write_baked_ply(each, [], baked, path, settings.channel)
        elif kind == ".ply":
            write_baked_ply(each, *shapes(settings.split), None, settings.channel)
        elif alone == ".glb" and settings.channel is None and (found := primitives(path)):
            add_baked_to_glb(each, *found, baked)
        else:
            write_baked_glb(each, *shapes(True), settings.channel)


def primitives(path: Path) -> tuple[tuple[dict[str, Any], bytes], list[tuple[int, int, int]]] | None:
    """JSON and binary chunk of a GLB, and (mesh, primitive, vertices) in the order of its reader; None where
    a mesh stands twice, or where the first buffer is no chunk of the file."""
    from illumcli.mesh_files.gltf import primitives_of
    from illumcli.mesh_files.gltf.document import open_document

    document = open_document(path)
    found = primitives_of(document)
    once = len({each[:2] for each in found}) == len(found)
    if not once or (document.items("buffers") and "uri" in document.item("buffers", 0)):
        return None
    return (document.json, document.chunk or b""), found


class _Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self._last = time.perf_counter()

    def lap(self, report: Report, name: str) -> None:
        now = time.perf_counter()
        report.seconds[name] = now - self._last
        self._last = now
