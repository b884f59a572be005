"""The files that a job writes: their names and what their pixels depend on."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.cache.fingerprint import digest
from illumcli.commands.options import RenderJob
from illumcli.errors import InputError
from illumcli.files.names import band_path, check_unique, expand, frame_field, with_forms
from illumcli.film.develop import Target
from illumcli.film.view import View
from illumcli.layers import Layer
from illumcli.render_graph.build import Graph
from illumcli.render_graph.keys import content_key
from illumcli.render_graph.schedule import error_is_audited, sampled_outputs
from illumcli.scene.access import refuse_outside
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene
from illumcli.scene.studio import STUDIO


def image_set(job: RenderJob, loaded: SceneFile, graph: Graph, outputs: tuple[Layer, ...]) -> list[Target]:
    """The files of all views: one with all layers per `.exr` pattern, one of each layer per `.png` pattern.

    Patterns of the scene must lead to folders that the scene may read; those of the command line may lead
    anywhere.
    """
    given = job.options.pattern
    patterns = (given,) if given else file_patterns(job, loaded, graph.scene)
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
                whole = Target(path, view, layers, file_content(graph, view, layers, suffix))
                targets.append(whole if job.rows is None else band_of(whole, job.rows))
    check_unique([str(target.path) for target in targets])
    return targets


def band_of(whole: Target, rows: tuple[int, int]) -> Target:
    """The file of some rows of a picture."""
    path, content = band_path(whole.path, rows), digest((whole.content, rows))
    return replace(whole, path=path, content=content, rows=rows, picture=whole.content)


def file_patterns(job: RenderJob, loaded: SceneFile, scene: Scene) -> Sequence[str]:
    """Name patterns of the scene; those that its author did not choose have the number of the frame, if there
    are frames."""
    frames = [
        *([] if job.frame is None else [job.frame]),
        *(scene.frames.numbers[-1:] if scene.frames else ()),
    ]
    written = loaded.tree.find(("outputs", "files"))
    if not frames or (written is not None and written.place.source != str(STUDIO)):
        return scene.outputs.files
    names = [os.path.splitext(pattern) for pattern in scene.outputs.files]
    return tuple(f"{stem}{frame_field(frames)}{suffix}" for stem, suffix in names)


def expanded(pattern: str, job: RenderJob, loaded: SceneFile, view: View, layer: str) -> Path:
    """The file that a pattern names for a view and layer of a job; frames have four digits by default."""
    fields = {"scene": loaded.name, "camera": view.name, "layer": layer, "frame": loaded.frame}
    return Path(expand(with_forms(pattern, {"frame": "04d"}), {**loaded.overrides, **fields, **job.fields}))


def file_content(graph: Graph, view: View, layers: Sequence[Layer], suffix: str) -> str:
    """Hash of everything that a file's pixels depend on: the buffers of its layers, and their encoding."""
    film = graph.scene.film
    coded = (suffix, view.name, [layer.name for layer in layers], graph.scene.outputs.colour)
    shown = (film.background, film.exposure if suffix == ".png" else 0.0)
    if error_is_audited(graph.scene, layers):  # of the beauty
        layers = sampled_outputs(layers)
    buffers = dict.fromkeys([*(layer.buffer for layer in layers), "alpha"])
    return digest((coded, shown, content_key(graph.nodes, view, buffers)))
