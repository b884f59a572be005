"""glTF materials in the terms of a scene.

metallic-roughness (3.9, appendix B) is the model `metallic_roughness`; KHR_materials_ior its index. Base
colour = factor * texture (sRGB) * COLOR_0; roughness = factor * G, metallic = factor * B of one texture
(linear). KHR_materials_unlit becomes emission.

KHR_materials_pbrSpecularGlossiness is approximated by Cook-Torrance with GGX of alpha = (1 - glossiness)^2
and Schlick's F. It gives diffuse and F0 directly.

Unsupported features (textures of normals; transparency; coats, sheen and so on) are counted, not
approximated. Where the texture of metal and roughness cannot be used, the material is not metallic.

References
----------
The Khronos Group (2021). glTF 2.0 specification, 2.0.1. ISO/IEC 12113:2022.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.mesh import Substitute
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files._files import TAKEN
from illumcli.mesh_files.gltf.document import (
    Document,
    extension,
    extensions,
    is_finite,
    is_index,
    is_inline,
    printable,
)
from illumcli.mesh_files.gltf.primitives import Part

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)
SMOOTHEST = 1e-4
"""Least alpha whose lobe can be resolved in single precision."""
LARGEST_INDEX = 1e3
"""Of refraction; it reflects all but 0.4 %."""
SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_USED = {
    "KHR_materials_unlit",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    SPECULAR_GLOSSINESS,
    "KHR_materials_variants",
}
_SHARE = (0.0, 1.0)
_REPEAT, _CLAMP, _MIRROR, _NEAREST = 10497, 33071, 33648, 9728
_WRAPS = {_REPEAT: "repeat", _CLAMP: "clamp", _MIRROR: "mirror"}
_NO_NUMBERS = "values of materials that are no finite numbers replaced by their defaults"
_OUTSIDE = "values of materials outside their range clipped to it"

Color = tuple[float, float, float]
Varying = Color | dict[str, Any]
"""A colour, or the keys of a texture or of vertex values."""


class _Missing(Exception):
    """An image that does not exist and was counted."""


class Library:
    """The materials of the parts of a document."""

    def __init__(self, document: Document, parts: list[Part]) -> None:
        self._document = document
        self._parts = parts
        self._names: dict[int | None, str] = {}
        self._coordinates: dict[tuple[int, tuple[float, ...]], str] = {}
        self.repairs: dict[str, Repair] = {}
        for part in parts:
            if part.material is None and "color" in part.attributes:
                self._names.setdefault(None, "vertex colours")
        for number in sorted({part.material for part in parts if part.material is not None}):
            name = document.item("materials", number).get("name")
            name = name if isinstance(name, str) and name else f"material {number}"
            taken = name in self._names.values()
            self._names[number] = f"{name} ({number})" if taken else name
        self.materials = {name: self._material(number) for number, name in self._names.items()}
        """Name -> keys of a scene's material."""
        self.occlusion = {
            name: keys
            for number, name in self._names.items()
            if number is not None and (keys := self._occlusion(number))
        }
        """Name -> keys of the occlusion texture, and its `strength`."""
        self.substitutes = {
            name: dict(_substitutes(self.materials[name], f": materials[{number}]"))
            for number, name in self._names.items()
        }
        """Name -> path of a parameter -> the value that replaces an unusable texture."""

    def name(self, part: Part) -> str | None:
        """Name of a part's material; None if it has neither a material nor colours."""
        if part.material is None and "color" not in part.attributes:
            return None
        return self._names[part.material]

    def coordinates(self) -> dict[str, NDArray[np.float32]]:
        """Attribute -> (V, 2) coordinates, v upwards, of textures with a transform or a uv set other than
        0."""
        tables_by_name = {}
        for (uv_set, transform), name in self._coordinates.items():
            tables = [
                part.uvs.get(uv_set, np.zeros((len(part.vertices), 2))).astype(np.float32)
                for part in self._parts
            ]
            tables_by_name[name] = _transformed(np.concatenate(tables), transform)
        return tables_by_name

    def _count(self, what: str, where: str) -> None:
        note(self.repairs, what, f": {where}")

    def _material(self, number: int | None) -> dict[str, Any]:
        """The keys of one material; number None is a material of vertex colours only."""
        if number is None:
            return {"model": "lambert", "diffuse": {"vertex": "color"}}
        material, where = self._document.item("materials", number), f"materials[{number}]"
        self._count_what_is_left_out(material, where)
        gloss = extension(material, SPECULAR_GLOSSINESS)
        metal = material.get("pbrMetallicRoughness", {})
        if not isinstance(metal, dict):
            self._count("parts of materials that are no objects left out", f"{where}.pbrMetallicRoughness")
            metal = {}

        # Emission.
        said = extension(material, "KHR_materials_emissive_strength")
        strength = self._number(number, said, "emissiveStrength", 1.0, (0.0, math.inf))
        emission = _scaled(
            self._color(number, material, ("emissiveFactor", "emissiveTexture"), BLACK), strength
        )

        # The base colour, times COLOR_0; then the workflow: unlit, specular-glossiness, metallic-roughness.
        names = ("diffuseFactor", "diffuseTexture") if gloss else ("baseColorFactor", "baseColorTexture")
        base = self._color(number, gloss or metal, names, WHITE)
        if any(part.material == number and "color" in part.attributes for part in self._parts):
            base = _by_vertex_colors(base)
        if "KHR_materials_unlit" in extensions(material):
            return {"model": "lambert", "diffuse": BLACK, "ambient": BLACK, "emission": base}
        if gloss:
            return self._specular_glossiness(number, gloss, base, emission)
        keys = {"model": "metallic_roughness", "base_color": base, "emission": emission}
        keys |= self._metal_and_roughness(number, metal)
        ior = self._index(number, extension(material, "KHR_materials_ior"))
        return keys if ior == 1.5 else keys | {"ior": ior}

    def _count_what_is_left_out(self, material: dict[str, Any], where: str) -> None:
        count = self._count
        if "specularGlossinessTexture" in extension(material, SPECULAR_GLOSSINESS):
            count("textures of specular and glossiness left out", where)
        if "normalTexture" in material:
            count("normal textures left out", where)
        mode = material.get("alphaMode", "OPAQUE")
        if mode in ("MASK", "BLEND"):
            count("transparent materials made opaque", where)
        elif mode != "OPAQUE":
            count(f"unknown alphaMode {printable(mode)} of materials taken as OPAQUE", where)
        for name in extensions(material):
            if name not in _USED:
                count(f"extension {printable(name)} of materials left out", where)

    def _specular_glossiness(
        self, number: int, gloss: dict[str, Any], base: Varying, emission: Varying
    ) -> dict[str, Any]:
        textured = "specularGlossinessTexture" in gloss
        f0 = self._factor(number, gloss, "specularFactor", WHITE)
        glossiness = self._number(number, gloss, "glossinessFactor", 1.0)
        if (
            textured
        ):  # the factors are the largest values that the texture leads to, no good guess at the rest
            f0, glossiness = (0.04, 0.04, 0.04), 0.0
        return _cook_torrance(_scaled(base, 1 - max(f0)), f0, (1 - glossiness) ** 2) | {
            "ambient": base,
            "emission": emission,
        }

    def _metal_and_roughness(self, number: int, metal: dict[str, Any]) -> dict[str, Any]:
        """`metallic` and `roughness`: factors times channels of one texture."""
        metallic, roughness = (
            self._number(number, metal, key, 1.0) for key in ("metallicFactor", "roughnessFactor")
        )
        info = metal.get("metallicRoughnessTexture")
        if info is None or not (metallic or roughness):
            return {"metallic": metallic, "roughness": roughness}
        texture = self._usable_texture(number, info, "metallicRoughnessTexture")
        if texture is None:  # the factor is the largest value that the texture leads to
            return {"metallic": 0.0, "roughness": roughness}
        texture["space"] = "linear"
        return {
            "metallic": _times({**texture, "channel": "b"}, metallic),
            "roughness": _times({**texture, "channel": "g"}, roughness),
        }

    def _color(self, number: int, entry: dict[str, Any], names: tuple[str, str], default: Color) -> Varying:
        """factor * texture of a material; the factor alone if there is no usable texture."""
        factor = self._factor(number, entry, names[0], default)
        info = entry.get(names[1])
        if info is None or not any(factor):
            return factor
        texture = self._usable_texture(number, info, names[1])
        if texture is None:
            return factor
        return texture if factor == WHITE else {**texture, "factor": factor}

    def _occlusion(self, number: int) -> dict[str, Any]:
        """The keys of a material's occlusion texture and its `strength`; empty without a usable one."""
        info = self._document.item("materials", number).get("occlusionTexture")
        if info is None:
            return {}
        texture = self._usable_texture(number, info, "occlusionTexture", "occlusion textures")
        if texture is None:
            return {}
        return {**texture, "strength": self._number(number, info, "strength", 1.0)}

    def _index(self, number: int, entry: dict[str, Any]) -> float:
        """The index of KHR_materials_ior, where 0 stands for one without a limit."""
        value = entry.get("ior", 1.5)
        if is_finite(value) and value == 0:
            return LARGEST_INDEX
        return min(self._number(number, entry, "ior", 1.5, (1.0, math.inf)), LARGEST_INDEX)

    def _factor(self, number: int, entry: dict[str, Any], key: str, default: Color) -> Color:
        """Three numbers clipped to 0..1; `default`, and counted, if they are none."""
        values, where = entry.get(key, list(default)), f"materials[{number}].{key}"
        if not isinstance(values, list) or len(values) < 3 or not all(map(is_finite, values[:3])):
            self._count(_NO_NUMBERS, where)
            return default
        r, g, b = (min(max(float(each), 0.0), 1.0) for each in values[:3])
        if [r, g, b] != values[:3]:
            self._count(_OUTSIDE, where)
        return r, g, b

    def _number(
        self,
        number: int,
        entry: dict[str, Any],
        key: str,
        default: float,
        limits: tuple[float, float] = _SHARE,
    ) -> float:
        """A number clipped to its range; `default`, and counted, if it is none."""
        value, where = entry.get(key, default), f"materials[{number}].{key}"
        if not is_finite(value):
            self._count(_NO_NUMBERS, where)
            return default
        clipped = min(max(float(value), limits[0]), limits[1])
        if clipped != value:
            self._count(_OUTSIDE, where)
        return clipped

    def _usable_texture(
        self, number: int, info: Any, key: str, kind: str = "textures"
    ) -> dict[str, Any] | None:
        """The keys of a texture of a material; None, and counted, if it cannot be used."""
        try:
            return self._texture(number, info)
        except _Missing:
            return None
        except InputError as error:
            reason = self._document.reason(error)
            self._count(f"{kind} left out ({reason})", f"materials[{number}].{key}")
            return None

    def _texture(self, number: int, info: Any) -> dict[str, Any]:
        """The keys of a texture; refused if it cannot be used."""
        document = self._document
        if not isinstance(info, dict):
            raise document.wrong("no texture")
        if info.get("index") is None:
            raise document.wrong("names no texture")
        texture = document.item("textures", info["index"])
        keys = {"texture": self._image(texture)}

        # Its texture coordinates and wrapping.
        transform = extension(info, "KHR_texture_transform")
        uv_set = document.integer(transform or info, "texCoord", "texture", info.get("texCoord", 0))
        if not any(uv_set in part.uvs for part in self._parts if part.material == number):
            raise document.wrong(f"no TEXCOORD_{uv_set} to look them up by")
        matrix = _transform(document, transform)
        if uv_set != 0 or matrix != _IDENTITY:
            name = f"uv{uv_set}" if matrix == _IDENTITY else f"uv{uv_set}_{len(self._coordinates) + 1}"
            keys["uv"] = self._coordinates.setdefault((uv_set, matrix), name)
        if "sampler" in texture:
            keys |= self._sampling(
                document.item("samplers", texture["sampler"]), f"samplers[{texture['sampler']}]"
            )
        return keys

    def _sampling(self, sampler: dict[str, Any], where: str) -> dict[str, str]:
        codes = [sampler.get(key, _REPEAT) for key in ("wrapS", "wrapT")]
        wraps = [_WRAPS.get(code, "repeat") if is_index(code) else "repeat" for code in codes]
        if wraps[0] != wraps[1]:
            self._count("textures that wrap in two ways, wrapped in the first", where)
        keys = {} if wraps[0] == "repeat" else {"wrap": wraps[0]}
        return keys | ({"filter": "nearest"} if sampler.get("magFilter") == _NEAREST else {})

    def _image(self, texture: dict[str, Any]) -> str:
        """The image of a texture: the path of a file, or ``FILE#images[N]`` for an embedded one."""
        document = self._document
        sources = [texture, *extensions(texture).values()]
        number = next((each["source"] for each in sources if "source" in each), None)
        if number is None:
            raise document.wrong("names no image")
        image = document.item("images", number)
        uri = image.get("uri")
        if str(image.get("mimeType")).startswith("image/ktx") or str(uri).lower().endswith((".ktx", ".ktx2")):
            raise document.wrong("KTX images are not read", "export the textures as PNG or JPEG")
        if isinstance(uri, str) and not is_inline(uri):
            path, fault = document.nearby(uri)
            if fault:
                self._count(f"textures {fault} {TAKEN if path else 'left out'}", f"images[{number}]")
            if path is None:
                raise _Missing
            return str(path)
        if uri is None:
            document.view(image.get("bufferView"))
        return f"{document.path}#images[{number}]"


def image_bytes(document: Document, number: int) -> bytes:
    """The encoded image of this number in a document.

    Raises
    ------
    InputError
        No such image, or unreadable data.
    """
    image = document.item("images", number)
    if "uri" in image:
        return document.resource(image["uri"], f"images[{number}].uri")
    data, start, end = document.view(image.get("bufferView"))
    return data[start:end]


def _substitutes(keys: dict[str, Any], first: str, prefix: str = "") -> Iterator[tuple[str, Substitute]]:
    """The path of each parameter that has a texture, and its substitute: its factor, and no metal."""
    for key, value in keys.items():
        if isinstance(value, dict) and "texture" in value:
            yield prefix + key, Substitute(BLACK if key == "metallic" else value.get("factor", WHITE), first)
        elif isinstance(value, dict):
            yield from _substitutes(value, first, f"{prefix}{key}.")


def _times(texture: dict[str, Any], factor: float) -> float | dict[str, Any]:
    """A texture of a number times a factor."""
    return 0.0 if factor == 0 else texture if factor == 1 else {**texture, "factor": (factor,) * 3}


def _cook_torrance(diffuse: Varying, f0: Varying, alpha: float) -> dict[str, Any]:
    return {
        "model": "cook_torrance",
        "diffuse": diffuse,
        "diffuse_weight": 1.0,
        "specular_weight": 1.0,
        "distribution": {"D": "ggx", "alpha": max(alpha, SMOOTHEST)},
        "fresnel": {"F": "schlick", "f0": f0},
    }


def _by_vertex_colors(base: Varying) -> dict[str, Any]:
    if isinstance(base, dict):
        return {**base, "vertex": "color"}
    return {"vertex": "color"} if base == WHITE else {"vertex": "color", "factor": base}


def _scaled(color: Varying, factor: float) -> Varying:
    if isinstance(color, dict):
        scaled = _scaled(color.get("factor", WHITE), factor)
        return BLACK if scaled == BLACK else color if scaled == WHITE else {**color, "factor": scaled}
    r, g, b = (each * factor for each in color)
    return r, g, b


_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def _transform(document: Document, transform: dict[str, Any]) -> tuple[float, ...]:
    """KHR_texture_transform as a to f: u' = a u + b v + c, v' = d u + e v + f, v downwards.

    offset * rotation * scale. The rotation is [c s; -s c], as in the extension's text and examples; the
    matrix that it prints rotates the other way.
    """
    x, y = document.numbers(transform, "offset", "KHR_texture_transform", (0.0, 0.0))
    width, height = document.numbers(transform, "scale", "KHR_texture_transform", (1.0, 1.0))
    angle = transform.get("rotation", 0.0)
    if not is_finite(angle):
        raise document.wrong("KHR_texture_transform.rotation must be a finite number")
    cosine, sine = math.cos(angle), math.sin(angle)
    return tuple(map(float, (cosine * width, sine * height, x, -sine * width, cosine * height, y)))


def _transformed(uv: NDArray[np.float32], transform: tuple[float, ...]) -> NDArray[np.float32]:
    """(V, 2) texture coordinates, v upwards before and after."""
    a, b, c, d, e, f = transform
    u, v = uv[:, 0], 1 - uv[:, 1]
    return np.stack([a * u + b * v + c, 1 - (d * u + e * v + f)], axis=1).astype(np.float32)
