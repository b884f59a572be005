"""Limits: the memory and disk that a run would take, checked before anything is read or allocated."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from illumcli.errors import InputError, LimitError
from illumcli.geometry.shapes._base import TRIANGLE_BYTES, Shape
from illumcli.layers import Layer
from illumcli.memory import in_words, refuse_beyond
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import Texture
from illumcli.render_graph.build import Graph
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.schedule import reached
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import MeshFile, Scene

BYTES_OF_FILES = {".obj": 8, ".ply": 14, ".stl": 14}
"""What a mesh takes in memory per byte of its file: a text of 80 bytes a triangle, or 43 binary ones."""
BYTES_OF_OTHER_FILES = 6
"""glTF, whose images take a part of the file."""
TEXEL_BYTES = 8
"""Of each channel: as a number, and as the channel that a parameter is read from."""
WHILE_READ = 4
"""More bytes of each channel for the texture that is being read."""
LARGEST_SIDE = 1 << 16
MOST_RAYS = 10**11
DENSEST = 20
"""No picture worth rendering packs better than this."""


def expected_memory(loaded: SceneFile, scene: Scene) -> dict[str, int]:
    """What a scene's shapes, mesh files and textures take [bytes], from counts, sizes and headers alone.

    Nothing is read but the headers of images. Files that are not there, or no images, count for nothing here,
    nor do those that mesh files name; their readers look at each of them.
    """
    sizes = {"shapes": 0, "meshes": 0, "textures": 0}
    for thing in scene.objects:
        source = scene.meshes.get(thing.mesh, thing.mesh) if isinstance(thing.mesh, str) else thing.mesh
        if isinstance(source, Shape):
            sizes["shapes"] += TRIANGLE_BYTES * source.triangles()
            continue
        path = loaded.folder / (source.file if isinstance(source, MeshFile) else str(source))
        if path.is_file():
            factor = BYTES_OF_FILES.get(path.suffix.lower(), BYTES_OF_OTHER_FILES)
            sizes["meshes"] += factor * path.stat().st_size
    texels = [_texels(loaded, texture) for texture in _textures(scene)]
    sizes["textures"] = TEXEL_BYTES * sum(texels) + WHILE_READ * max(texels, default=0)
    return {name: count for name, count in sizes.items() if count}


def _textures(scene: Scene) -> Iterator[tuple[str, str | None]]:
    """Path and space of each texture that materials of the scene name, once."""
    models: list[IlluminationModel] = []
    for thing in scene.objects:
        own = scene.material_of(thing)
        models += scene.materials.values() if own is None else [own]
        models += [fallback for fallback in [scene.fallback_of(thing)] if fallback is not None]
    values = (value for model in models for value in model.varying().values())
    yield from dict.fromkeys((value.texture, value.space) for value in values if isinstance(value, Texture))


def _texels(loaded: SceneFile, texture: tuple[str, str | None]) -> int:
    """Numbers in an image, by its header; 0 where it cannot be read, which its reader will say."""
    from illumcli.images.reader import texel_count

    try:
        return texel_count(resolve(loaded, texture[0]))
    except InputError:
        return 0


def refuse_memory(rows: int, width: int, values: int, expected: Mapping[str, int], place: str) -> None:
    """Raise LimitError where a band of `rows` and what is `expected` do not fit into the memory that is free.

    Parameters
    ----------
    rows, width : int
        Of the band that is held at once [pixels].
    values : int
        Numbers per pixel.
    expected : mapping of str to int
        As `expected_memory` has it [bytes].
    """
    sizes = {**expected, "film": 2 * 4 * rows * width * values}
    largest = max(sizes, key=lambda name: sizes[name])
    ways = {"film": "fewer layers or a smaller film", "meshes": "smaller or fewer meshes"}
    ways |= {"shapes": "shapes with fewer segments, rings or quads, or fewer of them"}
    what = f"{place}: {largest} of {in_words(sizes[largest])}" if len(sizes) > 1 else place
    refuse_beyond(sum(sizes.values()), what, f"ask for {ways.get(largest, 'smaller or fewer textures')}")


def refuse_rays(graph: Graph, outputs: Sequence[Layer]) -> None:
    """Raise LimitError where a film is larger, or rays are more, than this program takes on."""
    for view in graph.views:
        if max(view.width, view.height) > LARGEST_SIDE:
            raise LimitError(
                f"camera {view.name}: a film of {view.width} x {view.height} pixels is beyond the limit of "
                f"{LARGEST_SIDE} a side; render parts with a narrower camera"
            )
    rays = sum(expected_rays(graph.scene, graph.views, set(reached(graph, outputs))).values())
    if rays > MOST_RAYS:
        raise LimitError(
            f"{rays:.2g} rays are beyond the limit of {MOST_RAYS:.0e}; lower film.samples, "
            "obscurance.samples or the film's size"
        )


def refuse_disk(path: Path, pixel_bytes: int) -> None:
    """Raise LimitError where an image of so many bytes, well packed, does not fit beside `path`."""
    folder = path.absolute().parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        disk = os.statvfs(folder)
        free = disk.f_bavail * disk.f_frsize
    except OSError:
        return
    if pixel_bytes > DENSEST * free:
        raise LimitError(
            f"{path}: holds {in_words(pixel_bytes)} of pixels, {in_words(free)} are free on the disk; "
            "free some space, choose another folder or a smaller film"
        )
