"""Materials of a Wavefront MTL library in the terms of metallic-roughness.

Kd, map_Kd  base colour; the texture alone where there is one
d, Tr       alpha
map_d       the alpha of map_Kd, if both name one image
Pr, Pm      roughness, metallic (a later convention, which Blender writes)
Ns          otherwise: roughness = (2 / (Ns + 2))^(1/4), the lobe of equal width: alpha^2 = 2 / (Ns + 2) and
            glTF's alpha = roughness^2; 1 without a highlight (illum 0 and 1, or Ks 0)
Ke, map_Ke  emission
norm        normal texture

Ks has no counterpart: a dielectric reflects 4 % at normal incidence. Ka, Ni, Tf and sharpness belong to a
renderer's light or to transparency. Other maps are left out and named.

References
----------
Walter, B. et al. (2007). Microfacet models for refraction through rough surfaces. EGSR, section 5.3: the
exponent that matches a width alpha.
"""

from __future__ import annotations

import math
from pathlib import Path

from illumcli.errors import IllumError
from illumcli.mesh_files._files import content
from illumcli.mesh_files._words import without_comment
from illumcli.mesh_files.mtl import image_of, is_map, statements
from illumcli.mesh_files.pbr import Color, PbrMaterial

_TEXTURES = {"map_kd": "base_color", "map_ke": "emission", "norm": "normal"}


def read_pbr(path: Path, folder: Path) -> dict[str, PbrMaterial]:
    """The materials of a library by name; a library that cannot be read has none.

    Parameters
    ----------
    folder : Path
        Of the mesh; no image outside of it is opened.
    """
    try:
        lines = list(statements(content(path)))
    except IllumError:
        return {}
    by_name: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for _, word, rest in lines:
        if word == "newmtl":
            current = by_name.setdefault(without_comment(rest).rstrip(), {})
        else:
            current[word] = rest
    return {name: _material(name, said, path, folder) for name, said in by_name.items()}


def _material(name: str, said: dict[str, str], path: Path, folder: Path) -> PbrMaterial:
    # The images.
    images = {word: image_of(path, folder, text) for word, text in said.items() if is_map(word)}
    files = {word: str(image.file) for word, image in images.items() if image.file is not None}
    has_alpha = "map_d" in files and files["map_d"] == files.get("map_kd")
    textures = {part: files[word] for word, part in _TEXTURES.items() if word in files}
    known = {*_TEXTURES, *(("map_d",) if has_alpha else ())}
    left_out = [f"{word} of material {name}" for word in images if word not in known]
    options = [word for word in textures if images[_word(word)].has_options]

    # The lighting mode and the highlight.
    mode = _number(said, "illum", 2.0)
    has_highlight = mode >= 2 and max(_color(said, "ks") or (0.0,)) > 0
    width = (2 / (_number(said, "ns", 0.0) + 2)) ** 0.25 if has_highlight else 1.0
    emission = _color(said, "ke")
    if emission is None:
        emission = (1.0, 1.0, 1.0) if "emission" in textures else (0.0, 0.0, 0.0)
    return PbrMaterial(
        name,
        _clipped(_color(said, "kd") or (1.0, 1.0, 1.0)),
        min(_number(said, "d", 1 - min(_number(said, "tr", 0.0), 1.0)), 1.0),
        min(_number(said, "pm", 0.0), 1.0),
        min(_number(said, "pr", width), 1.0),
        emission,
        textures,
        tuple(part for part in textures if images[_word(part)].is_clamped),
        has_alpha,
        (*left_out, *(f"options of {_word(part)} of material {name}" for part in options)),
    )


def _word(part: str) -> str:
    """The statement of a texture."""
    return next(word for word, each in _TEXTURES.items() if each == part)


def _numbers(text: str) -> list[float]:
    """The numbers in front of a comment; none if a word is no finite number from 0."""
    try:
        values = [float(word) for word in text.partition("#")[0].split()]
    except ValueError:
        return []
    return values if all(math.isfinite(value) and value >= 0 for value in values) else []


def _number(said: dict[str, str], word: str, default: float) -> float:
    return next(iter(_numbers(said.get(word, ""))[-1:]), default)


def _color(said: dict[str, str], word: str) -> Color | None:
    values = _numbers(said.get(word, ""))
    if len(values) >= 3:
        return values[0], values[1], values[2]
    return (values[0],) * 3 if values else None


def _clipped(color: Color) -> Color:
    r, g, b = (min(each, 1.0) for each in color)
    return r, g, b
