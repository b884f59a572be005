"""Adds values to the meshes of a glTF document, of which nothing else changes, and writes it as a GLB."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from illumcli.mesh_files.color_change import ColorChange
from illumcli.mesh_files.gltf.document import Document, extensions, is_index, open_document, values_of
from illumcli.mesh_files.gltf.embed import embedded
from illumcli.mesh_files.gltf.glb_writer import VERTICES, GlbWriter
from illumcli.mesh_files.gltf.instances import distinct_meshes, forget_extension
from illumcli.mesh_files.gltf.placed_values import PrimitiveValues, placed_values
from illumcli.mesh_files.gltf.reindex import reindex
from illumcli.mesh_files.gltf.set_occlusion import set_occlusion
from illumcli.mesh_files.gltf.vertex_colors import vertex_colors, write_colors
from illumcli.mesh_files.gltf.well_formed import refuse_malformed
from illumcli.mesh_files.occlusion import NO_MAPS, OcclusionMaps
from illumcli.mesh_files.output_mesh import TEXTURE_UV, VertexData
from illumcli.mesh_files.split import split_vertices

OBSCURANCE = "_OBSCURANCE"
COMPRESSION = "KHR_draco_mesh_compression"


def extend_glb(path: Path, source: Path, data: VertexData, occlusion: OcclusionMaps = NO_MAPS) -> list[str]:
    """Write a glTF file as a GLB with `data` added to its primitives as attributes `_NAME`.

    A mesh that several nodes have is copied for nodes with other values; copies share all other attributes.
    Instances with different values become nodes. The vertices of a primitive are split if corners of one
    vertex have different values.

    Parameters
    ----------
    data : VertexData
        Rows in the order of `gltf.read`.
    occlusion : OcclusionMaps
        Textures of object 0, which is the whole file; their own uv become a further uv set.

    Returns
    -------
    list of str
        The parts of the document that the file does not have.
    """
    # The document in one chunk, with a mesh for each distinct set of values.
    left_out: list[str] = []
    document, writer = embedded(copyable(source), left_out)
    asset = document.json["asset"]
    extras = asset.get("extras")
    asset["extras"] = {**(extras if isinstance(extras, dict) else {}), "illum": data.sealed_about()}
    meshes = distinct_meshes(document, placed_values(document, data, occlusion.uvs.get(0)))

    # Add the values.
    owned = _replaceable(document)
    by_slot: dict[int, list[dict[str, Any]]] = {}
    for mesh, values_of_primitives in meshes.items():
        for values in values_of_primitives:
            primitive = document.json["meshes"][mesh]["primitives"][values.number]
            if COMPRESSION in extensions(primitive):
                del primitive["extensions"][COMPRESSION]
                left_out.append(f"the compressed form of primitives ({COMPRESSION})")
            left_out += _add_values(document, writer, primitive, values, data.color, owned)
            by_slot.setdefault(values.material, []).append(primitive)

    # Add the textures, all for one uv set.
    maps = {slot: each for (_, slot), each in occlusion.maps.items()}
    uv_set = _number_texture_uvs(by_slot) if 0 in occlusion.uvs else 0
    left_out += set_occlusion(document, writer, by_slot, maps, uv_set)
    if not any(COMPRESSION in extensions(each) for each in _primitives(document)):
        forget_extension(document.json, COMPRESSION)
    writer.write(path)
    return list(dict.fromkeys(left_out))


def copyable(source: Path) -> Document:
    """The document of a glTF file.

    Raises
    ------
    InputError
        It cannot be written again because a part of it is malformed.
    """
    document = open_document(source)
    refuse_malformed(document)
    return document


def _add_values(
    document: Document,
    writer: GlbWriter,
    primitive: dict[str, Any],
    values: PrimitiveValues,
    color: ColorChange | None,
    owned: set[int],
) -> list[str]:
    """Add values to a primitive. Returns the attributes that it loses.

    Parameters
    ----------
    color
        What obscurance does to `COLOR_0`.
    owned
        Accessors that may be replaced.
    """
    # Split the vertices if their corners differ.
    left_out: list[str] = []
    corners = values.triangles.ravel()
    count = len(next(iter(values.columns.values())))
    tables = [each.reshape(len(corners), -1) for each in values.at_corners.values()]
    split = split_vertices(corners, count, tables)
    attributes = primitive["attributes"]
    former = {name: attributes.pop(name, None) for name in values.columns}
    if len(split.source) > count:
        left_out += reindex(document, writer, primitive, split, owned)

    # Add the columns.
    columns = split.columns(values.columns, values.at_corners)
    if color is not None:
        colors, kind = vertex_colors(document, attributes, len(columns[OBSCURANCE]))
        write_colors(writer, attributes, color.applied(colors, columns[OBSCURANCE]), kind)
    for name, column in columns.items():
        if (number := former[name]) in owned:
            writer.replace_table(number, column.astype(np.float32), VERTICES)
            attributes[name] = number
        else:
            attributes[name] = writer.table(column.astype(np.float32), VERTICES)

    # Add the uv of textures.
    if TEXTURE_UV in values.at_corners:
        uvs = values.at_corners[TEXTURE_UV][np.maximum(split.corner, 0)]
        uvs = np.where(split.corner[:, None] >= 0, uvs, 0.0).astype(np.float32)
        attributes[TEXTURE_UV] = writer.table(uvs, VERTICES)
    return left_out


def _number_texture_uvs(by_slot: dict[int, list[dict[str, Any]]]) -> int:
    """Make the uv of textures the first uv set that no primitive has; missing sets before it are the same."""
    tables = [primitive["attributes"] for primitives in by_slot.values() for primitive in primitives]
    uv_set = max(sum(name.startswith("TEXCOORD_") for name in each) for each in tables)
    for each in tables:
        accessor = each.pop(TEXTURE_UV)
        for number in range(uv_set + 1):
            each.setdefault(f"TEXCOORD_{number}", accessor)
    return uv_set


def _replaceable(document: Document) -> set[int]:
    """Accessors that one primitive refers to, once, and that alone refer to their buffer view."""
    uses: Counter[int] = Counter()
    for primitive in _primitives(document):
        for each in (primitive.get("attributes", {}), *primitive.get("targets", [])):
            uses.update(each.values())
        uses.update([primitive["indices"]] if "indices" in primitive else [])
    views = Counter(each for each in values_of(document.json, "bufferView") if is_index(each))
    accessors = document.items("accessors")
    return {
        number
        for number, count in uses.items()
        if count == 1 == views[accessors[number].get("bufferView")] and "sparse" not in accessors[number]
    }


def _primitives(document: Document) -> list[dict[str, Any]]:
    return [primitive for mesh in document.items("meshes") for primitive in mesh.get("primitives", [])]
