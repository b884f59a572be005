"""Materials of the metallic-roughness model in a glTF document."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from illumcli.mesh_files.gltf.glb_writer import GlbWriter, appended
from illumcli.mesh_files.occlusion import OcclusionMap
from illumcli.mesh_files.pbr import PbrMaterial

Encoded: TypeAlias = Callable[[str], tuple[bytes, str]]
"""Image file, or ``FILE#images[N]`` -> the encoded PNG or JPEG and its media type."""

_CLAMP, _REPEAT = 33071, 10497
_STRENGTH = "KHR_materials_emissive_strength"


def occlusion_texture(writer: GlbWriter, occlusion: OcclusionMap, uv_set: int) -> dict[str, int]:
    """Add an occlusion texture. Returns what a material says of it."""
    image = writer.image(occlusion.png, "image/png", occlusion.name)
    texture = appended(writer.json.setdefault("textures", []), {"source": image})
    return {"index": texture, **({"texCoord": uv_set} if uv_set else {})}


class MaterialWriter:
    """Adds materials to a document, each of them, each image and each texture once."""

    def __init__(self, writer: GlbWriter, encoded: Encoded) -> None:
        self._writer, self._encoded = writer, encoded
        self._materials: list[tuple[PbrMaterial, tuple[OcclusionMap, int] | None]] = []
        self._images: dict[str, int] = {}
        self._textures: dict[tuple[str, bool], int] = {}

    def number(self, material: PbrMaterial, occlusion: tuple[OcclusionMap, int] | None = None) -> int:
        """Number of a material in the document, with an occlusion texture for a uv set, if one is given."""
        if (material, occlusion) in self._materials:
            return self._materials.index((material, occlusion))
        self._materials.append((material, occlusion))
        entry = self._entry(material)
        if occlusion is not None:
            entry["occlusionTexture"] = occlusion_texture(self._writer, *occlusion)
        return appended(self._writer.json.setdefault("materials", []), entry)

    def _entry(self, material: PbrMaterial) -> dict[str, Any]:
        """A material as JSON. It is seen from both sides, as in formats that have no single-sided ones."""
        texture = {part: {"index": self._texture(material, part)} for part in material.textures}
        has_base = "base_color" in texture
        factor = [*((1.0, 1.0, 1.0) if has_base else material.base_color), material.alpha]
        surface: dict[str, Any] = {
            "baseColorFactor": factor,
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
        if has_base:
            surface["baseColorTexture"] = texture["base_color"]
        entry: dict[str, Any] = {
            "name": material.name,
            "pbrMetallicRoughness": surface,
            "doubleSided": True,
        }
        if material.alpha < 1 or material.has_texture_alpha:
            entry["alphaMode"] = "BLEND"
        if "normal" in texture:
            entry["normalTexture"] = texture["normal"]

        # Emission; the factor is at most 1, more is its strength.
        if any(material.emission):
            strength = max(*material.emission, 1.0)
            entry["emissiveFactor"] = [each / strength for each in material.emission]
            if "emission" in texture:
                entry["emissiveTexture"] = texture["emission"]
            if strength > 1:
                entry["extensions"] = {_STRENGTH: {"emissiveStrength": strength}}
                used = self._writer.json.setdefault("extensionsUsed", [])
                used += [_STRENGTH] if _STRENGTH not in used else []
        return entry

    def _texture(self, material: PbrMaterial, part: str) -> int:
        image, is_clamped = material.textures[part], part in material.clamped
        if (image, is_clamped) not in self._textures:
            mode = _CLAMP if is_clamped else _REPEAT
            sampler = appended(self._writer.json.setdefault("samplers", []), {"wrapS": mode, "wrapT": mode})
            entry = {"source": self._image(image), "sampler": sampler}
            self._textures[image, is_clamped] = appended(self._writer.json.setdefault("textures", []), entry)
        return self._textures[image, is_clamped]

    def _image(self, image: str) -> int:
        if image not in self._images:
            data, kind = self._encoded(image)
            name = image.rpartition("/")[2].rpartition(".")[0] or image
            self._images[image] = self._writer.image(data, kind, name)
        return self._images[image]
