"""The work of a job: its graph, its layers and the files to write."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING

from illumcli.cache.fingerprint import FileFingerprints, digest
from illumcli.commands.image_store import ImageFiles, ImageStore
from illumcli.commands.options import RenderJob
from illumcli.commands.targets import image_set
from illumcli.errors import LimitError
from illumcli.files.claims import claim_path
from illumcli.film.develop import Development, Target
from illumcli.film.tiles import MAX_TILE_SAMPLES
from illumcli.layers import Layer
from illumcli.records import Value
from illumcli.render_graph.build import Graph, build
from illumcli.render_graph.limits import expected_memory, refuse_disk, refuse_memory, refuse_rays
from illumcli.render_graph.needs import reconstructs
from illumcli.render_graph.schedule import error_is_audited, outputs_of
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene

if TYPE_CHECKING:
    from illumcli.accuracy.audit import AuditedError

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
    audited: Mapping[str, AuditedError] = field(default_factory=dict)
    """Errors of cameras that are known before they are rendered."""
    images: ImageStore = ImageFiles()
    """Where its images go."""

    @property
    def scene(self) -> Scene:
        return self.graph.scene

    @property
    def development(self) -> Development:
        """How its layers become pixels of files."""
        film = self.scene.film
        return Development(film.background, film.exposure, self.scene.outputs.colour)

    @property
    def contents(self) -> tuple[str, ...]:
        """Hash of everything that the pixels of each file depend on."""
        return tuple(target.content for target in self.targets)

    @property
    def content(self) -> str:
        """Hash of everything that the pixels of its files depend on."""
        return digest(self.contents)

    @property
    def claim(self) -> Path | None:
        """The path of the claim on this work; None with `force`, which does it whoever has done it."""
        return None if self.job.options.force else claim_path(self.targets[0].path, self.content)

    @property
    def whole_because(self) -> str:
        """Why its pictures are not cut into bands for several workers; empty if large ones are."""
        if self.job.options.target_error is not None:
            return "sample counts are chosen for its target error"
        if reconstructs(self.scene):
            return "obscurance is reconstructed from the pixels around, and audited"
        return ""

    def due(self) -> list[Target]:
        """The files to write, without those that exist with the same content.

        Raises
        ------
        OutputError
            A different file exists and the job has not `force`; a file cannot be written.
        LimitError
            Memory or disk cannot hold what is due.
        """
        due = self.images.due(self.targets, self.job.options.force)
        refuse_too_large(self, due)
        return due


def prepared(job: RenderJob) -> Work:
    """The work of a job. Reads no mesh.

    Raises
    ------
    InputError, LimitError
        Any fault that can be found before rendering.
    """
    return work_of(job, load(job.scene, job.options.overrides, frame=job.frame))


def work_of(job: RenderJob, loaded: SceneFile, files: FileFingerprints | None = None) -> Work:
    """The same for a scene that was loaded already; its variants share the fingerprints of `files`."""
    options = job.options
    scene = loaded.scene if options.seed is None else loaded.scene.model_copy(update={"seed": options.seed})
    graph, outputs = build(scene, loaded, files), outputs_of(scene, options.only)
    refuse_rays(graph, outputs)
    refuse_large_errors(graph, outputs)
    targets = image_set(job, loaded, graph, outputs)
    return Work(job, loaded, graph, outputs, tuple(targets))


def refuse_large_errors(graph: Graph, outputs: Sequence[Layer]) -> None:
    """Raise LimitError if the layer `error` needs the audit of a picture that is too large to be held."""
    if not error_is_audited(graph.scene, outputs):
        return
    from illumcli.accuracy.sampled_blocks import MOST_PIXELS

    for view in graph.views:
        if view.width * view.height > MOST_PIXELS:
            raise LimitError(
                f"camera {view.name}: the layer error of reconstructed obscurance needs a whole picture, of "
                f"at most {MOST_PIXELS:,} pixels; leave it out, render a smaller film, or set "
                "obscurance.reconstruct=false"
            )


def refuse_too_large(work: Work, due: Sequence[Target]) -> None:
    """Raise LimitError if memory or disk cannot hold the files that are due; reads and writes nothing."""
    values = sum(len(layer.channels) for layer in work.outputs) + 1
    expected = expected_memory(work.loaded, work.scene) if due else {}
    is_held = work.images.held or error_is_audited(work.scene, work.outputs)  # until the audit
    for target in due:
        view = target.view
        rows = target.height if is_held else BAND_ROWS
        refuse_memory(rows, view.width, values, expected, str(work.loaded.path))
        if work.images.held:
            continue
        types = work.development.channels(target).values()
        refuse_disk(target.path, view.width * target.height * sum(BYTES[kind] for kind in types))
