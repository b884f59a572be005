"""Gives materials of a glTF document occlusion textures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

from illumcli.mesh_files.gltf.document import Document, is_index, values_of
from illumcli.mesh_files.gltf.glb_writer import GlbWriter, appended
from illumcli.mesh_files.gltf.pbr import occlusion_texture
from illumcli.mesh_files.occlusion import OcclusionMap

_KEY = "occlusionTexture"


def set_occlusion(
    document: Document,
    writer: GlbWriter,
    primitives: Mapping[int, list[dict[str, Any]]],
    maps: Mapping[int, OcclusionMap],
    uv_set: int,
) -> list[str]:
    """Give the materials of primitives occlusion textures. Returns what was replaced.

    A material that other primitives have, too, is copied. A texture that packs occlusion with roughness and
    metalness stays that of these two.

    Parameters
    ----------
    primitives : mapping of int to list of dict
        Those that have each of `maps`, by the same keys; they share a material, or have none. Primitives
        without this uv set stay without the texture.
    """
    left_out = []
    attribute = f"TEXCOORD_{uv_set}"
    users = Counter(each.get("material") for each in _all_primitives(document))
    for key, occlusion in maps.items():
        own = [each for each in primitives.get(key, []) if attribute in each["attributes"]]
        if not own:
            continue
        number: int | None = own[0].get("material")
        materials = document.json.setdefault("materials", [])
        if number is None:
            number = appended(materials, {})
        elif users[number] > len(own):
            number = appended(materials, deepcopy(materials[number]))
        material = materials[number]
        former = material.pop(_KEY, None)
        if former is not None:
            left_out.append(f"the former occlusion texture of material {material.get('name', number)}")
        if former is None or not _replaced(document, writer, former, occlusion):
            material[_KEY] = occlusion_texture(writer, occlusion, uv_set)
        else:
            material[_KEY] = {"index": former["index"], **({"texCoord": uv_set} if uv_set else {})}
        for primitive in own:
            primitive["material"] = number
    return left_out


def _replaced(document: Document, writer: GlbWriter, former: Any, occlusion: OcclusionMap) -> bool:
    """Replace the image of a texture that nothing else uses. False if there is no such texture."""
    textures, images = document.items("textures"), document.items("images")
    index: Any = former.get("index") if isinstance(former, dict) else None
    texture = _only(textures, index, _texture_numbers(document.items("materials")), uses=0)
    number: Any = texture.get("source")
    image = _only(images, number, values_of(textures, "source"), uses=1)
    view = image.get("bufferView")
    if not _only(document.items("bufferViews"), view, values_of(document.json, "bufferView"), uses=1):
        return False
    images[number] = {
        "bufferView": writer.view(occlusion.png, view),
        "mimeType": "image/png",
        "name": occlusion.name,
    }
    textures[index] = {"source": number}
    return True


def _only(items: list[Any], index: Any, references: Iterator[Any], uses: int) -> dict[str, Any]:
    """Item `index` of a list if there are as many references to it, otherwise an empty one."""
    is_there = is_index(index) and index < len(items) and sum(each == index for each in references) == uses
    item: dict[str, Any] = items[index] if is_there else {}
    return item


def _all_primitives(document: Document) -> Iterator[dict[str, Any]]:
    for mesh in document.items("meshes"):
        yield from mesh.get("primitives", [])


def _texture_numbers(value: Any) -> Iterator[int]:
    """The textures that a part of the JSON names."""
    if isinstance(value, dict):
        for key, each in value.items():
            if key.endswith("Texture") and isinstance(each, dict) and is_index(each.get("index")):
                yield each["index"]
            yield from _texture_numbers(each)
    elif isinstance(value, list):
        for each in value:
            yield from _texture_numbers(each)
