"""The work of a job: its graph, its layers and the files to write."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from illumcli.cache.fingerprint import FileFingerprints, digest
from illumcli.commands.options import RenderJob
from illumcli.errors import InputError
from illumcli.files.names import check_unique, expand
from illumcli.files.outputs import is_kept
from illumcli.film.develop import Development, Target
from illumcli.film.tiles import MAX_TILE_SAMPLES
from illumcli.film.view import View
from illumcli.images.contents import image_contents
from illumcli.layers import Layer
from illumcli.records import Value
from illumcli.render_graph.build import Graph, build
from illumcli.render_graph.keys import content_key
from illumcli.render_graph.limits import expected_memory, refuse_disk, refuse_memory, refuse_rays
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.access import refuse_outside
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile, lacking_lines, unused_lines
from illumcli.scene.spec import Scene

BAND_ROWS = math.isqrt(MAX_TILE_SAMPLES)
"""Greatest height of a band of tiles [pixels]."""
BYTES = {"half": 2, "float": 4, "uint": 4, "uint8": 1, "uint16": 2}


class Work(Value):
    """A scene to render: its graph, the requested layers and the files to write."""

    job: RenderJob
    loaded: SceneFile
    graph: Graph
    outputs: tuple[Layer, ...]
    targets: tuple[Target, ...]

    @property
    def scene(self) -> Scene:
        return self.graph.scene

    @property
    def development(self) -> Development:
        """How its layers become pixels of files."""
        film = self.scene.film
        return Development(film.background, film.exposure, self.scene.outputs.colour)

    @property
    def content(self) -> str:
        """Hash of everything that the pixels of its files depend on."""
        return digest([target.content for target in self.targets])

    def due(self) -> list[Target]:
        """The files to write, without those that exist with the same content.

        Raises
        ------
        OutputError
            A different file exists and the job has not `force`; a file cannot be written.
        LimitError
            Memory or disk cannot hold what is due.
        """
        force = self.job.options.force
        due = [each for each in self.targets if not is_kept(each.path, [each.content], image_contents, force)]
        refuse_too_large(self, due)
        return due


def prepared(job: RenderJob) -> Work:
    """The work of a job. Reads no mesh.

    Raises
    ------
    InputError, LimitError
        Any fault that can be found before rendering.
    """
    return work_of(job, load(job.scene, job.options.overrides))


def work_of(job: RenderJob, loaded: SceneFile, files: FileFingerprints | None = None) -> Work:
    """The same for a scene that was loaded already; its variants share the fingerprints of `files`."""
    options = job.options
    scene = loaded.scene if options.seed is None else loaded.scene.model_copy(update={"seed": options.seed})
    graph, outputs = build(scene, loaded, files), outputs_of(scene, options.only)
    refuse_rays(graph, outputs)
    targets = image_set(job, loaded, graph, outputs)
    return Work(job, loaded, graph, outputs, tuple(targets))


def image_set(job: RenderJob, loaded: SceneFile, graph: Graph, outputs: tuple[Layer, ...]) -> list[Target]:
    """The files of all views: one with all layers per `.exr` pattern, one of each layer per `.png` pattern.

    Patterns of the scene must lead to folders that the scene may read; those of the command line may lead
    anywhere.
    """
    given = job.options.pattern
    patterns = (given,) if given else graph.scene.outputs.files
    targets = []
    for view in graph.views:
        if job.cameras and view.name not in job.cameras:
            continue
        for number, pattern in enumerate(patterns):
            suffix = Path(pattern).suffix.lower()
            if suffix not in (".exr", ".png"):
                raise InputError(f"output pattern '{pattern}': no image format '{suffix}'; use .exr or .png")
            sets = [outputs] if suffix == ".exr" else [(layer,) for layer in outputs]
            for layers in sets:
                name = "all" if suffix == ".exr" else layers[0].name
                path = expanded(pattern, job, loaded, view, name)
                if not given:
                    refuse_outside(loaded, number, path)
                targets.append(Target(path, view, layers, file_content(graph, view, layers, suffix)))
    check_unique([str(target.path) for target in targets])
    return targets


def expanded(pattern: str, job: RenderJob, loaded: SceneFile, view: View, layer: str) -> Path:
    """The file that a pattern names for a view and layer of a job."""
    fields = {"scene": loaded.name, "camera": view.name, "layer": layer, "frame": 0}
    return Path(expand(pattern, {**loaded.overrides, **fields, **job.fields}))


def file_content(graph: Graph, view: View, layers: Sequence[Layer], suffix: str) -> str:
    """Hash of everything that a file's pixels depend on: the buffers of its layers, and their encoding."""
    film = graph.scene.film
    coded = (suffix, view.name, [layer.name for layer in layers], graph.scene.outputs.colour)
    shown = (film.background, film.exposure if suffix == ".png" else 0.0)
    buffers = dict.fromkeys([*(layer.buffer for layer in layers), "alpha"])
    return digest((coded, shown, content_key(graph.nodes, view, buffers)))


def unused_keys(work: Work) -> list[str]:
    """A line for each value of the scene that has no effect, and for each part that its pictures lack."""
    files = () if work.job.options.pattern else work.scene.outputs.files
    layers = [layer.name for layer in work.outputs]
    lacking = lacking_lines(work.loaded, work.scene, layers)
    return lacking + unused_lines(work.loaded, work.scene, layers, files)


def refuse_too_large(work: Work, due: Sequence[Target]) -> None:
    """Raise LimitError if memory or disk cannot hold the files that are due; reads and writes nothing."""
    values = sum(len(layer.channels) for layer in work.outputs) + 1
    expected = expected_memory(work.loaded, work.scene) if due else {}
    for target in due:
        view = target.view
        refuse_memory(BAND_ROWS, view.width, values, expected, str(work.loaded.path))
        types = work.development.channels(target).values()
        refuse_disk(target.path, view.width * view.height * sum(BYTES[kind] for kind in types))
