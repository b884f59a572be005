"""Limits: the memory, disk space and rays of a run, checked before anything is read or allocated."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.geometry.instances import MOST_STRETCH
from illumcli.geometry.shapes._base import TRIANGLE_BYTES, Shape
from illumcli.layers import Layer
from illumcli.memory import in_words, refuse_beyond
from illumcli.mesh_files import companions, is_mesh_file
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import Texture, maps_of
from illumcli.render_graph import needs
from illumcli.render_graph.build import Graph
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.schedule import reached
from illumcli.scene.access import resolve
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Matrix, MeshFile, Scene
from illumcli.schema.fields import Vector

BYTES_OF_FILES = {".obj": 8, ".ply": 14, ".stl": 14}
"""Memory of a mesh per byte of its file; a triangle takes 80 bytes of text, or 43 of binary."""
BYTES_OF_OTHER_FILES = 6
"""The same for glTF, where images are part of the file."""
NO_IMAGES = (".mtl", ".bin")
"""Suffixes of files that mesh files name and that are no images."""
LARGEST_SIDE = 1 << 16
MOST_RAYS = 10**11
DENSEST = 20
"""Upper bound on the compression ratio of an image."""


def expected_memory(loaded: SceneFile, scene: Scene, shares_meshes: bool = True) -> dict[str, int]:
    """Memory of a scene's shapes, mesh files and textures [bytes], from counts, file sizes and image headers.

    A mesh that objects share counts for two of them, since it may be stored with its mirror image; each
    counts if not `shares_meshes`. Missing files and files that are not images count as 0; their readers check
    each of them. Of images that mesh files name, those count that materials may use; images inside a mesh
    file are part of its size.
    """
    sizes = {"shapes": 0, "meshes": 0, "textures": 0}
    of_file: dict[Path, int] = {}  # each file is looked at once
    paths: dict[str, Path] = {}
    importing: dict[Path, None] = {}
    shared: Counter[str] = Counter()
    for thing in scene.objects:
        name, is_sharing = (
            needs.mesh_name(scene, thing.mesh),
            shares_meshes and _stretch(thing.transform.scale, thing.transform.matrix) <= MOST_STRETCH,
        )
        shared[name] += is_sharing
        is_stored = not is_sharing or shared[name] <= 2
        source = scene.meshes.get(thing.mesh, thing.mesh) if isinstance(thing.mesh, str) else thing.mesh
        if isinstance(source, Shape):
            sizes["shapes"] += TRIANGLE_BYTES * source.triangles() if is_stored else 0
            continue
        file = source.file if isinstance(source, MeshFile) else str(source)
        if file not in paths:
            paths[file] = loaded.folder / file
        path = paths[file]
        if path not in of_file:
            of_file[path] = _mesh_bytes(path)
        sizes["meshes"] += of_file[path] if is_stored else 0
        if needs.imports(scene, thing):
            importing[path] = None
    images = dict.fromkeys(image for path in importing for image in _images_of(path))
    sizes["textures"] = sum(_texture_bytes(loaded, texture) for texture in _textures(scene))
    sizes["textures"] += sum(_image_bytes(image) for image in images)
    for file in dict.fromkeys(needs.files_of_obscurance(scene).values()):
        path = loaded.folder / file
        if is_mesh_file(path):
            sizes["meshes"] += 0 if path in of_file else _mesh_bytes(path)
        elif path.suffix.lower() != ".npz":
            sizes["textures"] += _texture_bytes(loaded, (file, None))
    return {name: count for name, count in sizes.items() if count}


def _mesh_bytes(path: Path) -> int:
    """Memory of a mesh, from the size of its file; 0 if there is none."""
    factor = BYTES_OF_FILES.get(path.suffix.lower(), BYTES_OF_OTHER_FILES)
    return factor * path.stat().st_size if path.is_file() else 0


@lru_cache(maxsize=1 << 10)
def _stretch(scale: Vector, matrix: Matrix | None) -> float:
    """Upper bound on the ratio of the axes of a transform."""
    axes = np.abs(scale)
    if not axes.min():
        return np.inf
    of_matrix = 1.0
    if matrix is not None:
        of_matrix = float(np.linalg.cond(np.asarray(matrix)[:3, :3]))
    return float(axes.max() / axes.min()) * of_matrix


def _textures(scene: Scene) -> Iterator[tuple[str, str | None]]:
    """Path and colour space of each texture that the scene's materials name, without repeats."""
    models: dict[int, IlluminationModel] = {}  # each once, however many objects have it
    by_name = False
    for thing in scene.objects:
        own, fallback = scene.material_of(thing), scene.fallback_of(thing)
        by_name |= own is None
        models |= {id(model): model for model in (own, fallback) if model is not None}
    if by_name:
        models |= {id(model): model for model in scene.materials.values()}
    varying = (value for model in models.values() for value in model.varying().values())
    values = (each for value in varying for each in maps_of(value))
    yield from dict.fromkeys((value.texture, value.space) for value in values if isinstance(value, Texture))


def _images_of(mesh: Path) -> list[Path]:
    """The images that a mesh file or its material libraries name."""
    return [file for file in companions(mesh) if file.suffix.lower() not in NO_IMAGES and file.is_file()]


def _texture_bytes(loaded: SceneFile, texture: tuple[str, str | None]) -> int:
    """Memory of a texture, from its header; 0 if it is unreadable, which its reader reports."""
    try:
        return _image_bytes(resolve(loaded, texture[0]))
    except InputError:
        return 0


def _image_bytes(path: Path) -> int:
    """Memory of an image, from its header; 0 if it is unreadable, which its reader reports."""
    from illumcli.images.reader import texture_bytes

    try:
        return texture_bytes(path)
    except InputError:
        return 0


def refuse_memory(rows: int, width: int, values: int, expected: Mapping[str, int], place: str) -> None:
    """Raise LimitError if a band of `rows` and the `expected` memory do not fit into the free memory.

    Parameters
    ----------
    rows, width : int
        Size of the band that is held at once [pixels].
    values : int
        Numbers per pixel.
    expected : mapping of str to int
        From `expected_memory` [bytes].
    """
    sizes = {**expected, "film": 2 * 4 * rows * width * values}
    largest = max(sizes, key=lambda name: sizes[name])
    advice = {"film": "fewer layers or a smaller film", "meshes": "smaller or fewer meshes"}
    advice |= {"shapes": "shapes with fewer segments, rings or quads, or fewer of them"}
    what = f"{place}: {largest} of {in_words(sizes[largest])}" if len(sizes) > 1 else place
    refuse_beyond(sum(sizes.values()), what, f"ask for {advice.get(largest, 'smaller or fewer textures')}")


def refuse_rays(graph: Graph, outputs: Sequence[Layer]) -> None:
    """Raise LimitError if a film is larger than `LARGEST_SIDE`, or there are more rays than `MOST_RAYS`."""
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
    """Raise LimitError if an image of `pixel_bytes` does not fit on the disk of `path`, even compressed."""
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
