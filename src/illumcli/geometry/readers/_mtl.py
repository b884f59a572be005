"""Wavefront MTL: the material library of OBJ files, as keys of a scene's materials.

illum 0             the colour Kd, whatever the light
illum 1             Ka ambient + Kd n.l
illum 2 and above   Ka ambient + Kd n.l + Ks (n.h)^Ns, h half way between light and eye

Those are `blinn_phong` as it stands: intensities, without 1/pi. What it has no word for (transparency,
reflection, refraction, factors and placement of textures) is counted, not guessed.

References
----------
Wavefront Technologies (1995). MTL material format, version 4.2. Ke is a later custom, meant as emission.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from illumcli.errors import InputError
from illumcli.geometry.readers._files import beside, content
from illumcli.geometry.readers._polygons import LARGEST
from illumcli.geometry.repairs import Repair, note

_COLORS = ("Ka", "Kd", "Ks", "Ke")
_NUMBERS = ("Ns", "d", "Tr", "illum")
_OPTIONS = {
    "-blendu",
    "-blendv",
    "-boost",
    "-bm",
    "-cc",
    "-clamp",
    "-imfchan",
    "-texres",
    "-type",
}  # one word
_VECTORS = {"-o", "-s", "-t"}  # one to three numbers

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


def read(path: Path) -> tuple[dict[str, dict[str, Any]], dict[str, Repair]]:
    """Material name -> keys of a scene's material, and what was left out.

    The path of a texture begins as `path` does.
    """
    left_out: dict[str, Repair] = {}
    values: dict[str, dict[str, Any]] = {}
    lines: dict[str, str] = {}
    current: dict[str, Any] | None = None
    for number, line in enumerate(content(path).decode("utf-8", "replace").splitlines(), start=1):
        word, _, rest = line.strip().replace("\t", " ").partition(" ")
        rest = rest.strip()
        place = f"{path}:{number}"
        if word == "newmtl":
            current = values.setdefault(rest, {})
            lines.setdefault(rest, f"{path.name}:{number}")
        elif word not in (*_COLORS, *_NUMBERS, "map_Kd"):
            continue
        elif current is None:
            raise InputError(f"{place}: {word} stands before any material; begin with newmtl NAME")
        elif word == "map_Kd":
            current[word] = _texture(path, place, rest, left_out)
        elif word in _COLORS:
            current[word] = _color(place, rest, left_out)
        else:
            current[word] = _numbers(place, rest.split()[-1:])[0]
    return {name: _material(found, lines[name], left_out) for name, found in values.items()}, left_out


def _material(found: dict[str, Any], line: str, left_out: dict[str, Repair]) -> dict[str, Any]:
    """The keys of a scene's material for the statements of one MTL material."""
    found = {word: value for word, value in found.items() if value is not None}
    diffuse = found.get("map_Kd", found.get("Kd"))
    if "map_Kd" in found and found.get("Kd", WHITE) != WHITE:
        note(left_out, "factors Kd of a texture left out", line)
    if found.get("d", 1.0) < 1 or found.get("Tr", 0.0) > 0:
        note(left_out, "transparent materials made opaque", line)
    illum = found.get("illum", 2.0)
    if illum > 2:
        note(left_out, "reflection of materials left out", line)
    if illum == 0:
        light = WHITE if diffuse is None else diffuse
        return {
            "model": "blinn_phong",
            "diffuse": BLACK,
            "specular": BLACK,
            "ambient": BLACK,
            "emission": light,
        }
    keys = {
        "diffuse": diffuse,
        "specular": found.get("Ks", BLACK) if illum >= 2 else BLACK,
        "exponent": found.get("Ns"),
        "emission": found.get("Ke"),
        "ambient": found.get("Ka"),
    }
    return {"model": "blinn_phong", **{key: value for key, value in keys.items() if value is not None}}


def _color(place: str, text: str, left_out: dict[str, Repair]) -> tuple[float, ...] | None:
    words = text.split()
    if words[:1] in (["spectral"], ["xyz"]):
        note(left_out, "spectral and XYZ colours left out", Path(place).name)
        return None
    values = _numbers(place, words[:3])
    return values if len(values) == 3 else values[:1] * 3


def _numbers(place: str, words: list[str]) -> tuple[float, ...]:
    if not words:
        raise InputError(f"{place}: has no number; write one, or remove the line")
    try:
        values = tuple(map(float, words))
    except ValueError:
        raise InputError(f"{place}: '{' '.join(words):.40}' is no number; write a decimal point") from None
    if not all(math.isfinite(value) and 0 <= value <= LARGEST for value in values):
        raise InputError(f"{place}: must be from 0 to {LARGEST:g}, is {' '.join(words):.40}; correct it")
    return values


def _texture(path: Path, place: str, text: str, left_out: dict[str, Repair]) -> dict[str, str] | None:
    """The texture a map statement names, without its options; None where it lies outside the folder."""
    texture: dict[str, str] = {}
    words = text.split()
    while words and words[0] in (_OPTIONS | _VECTORS | {"-mm"}):
        option = words.pop(0)
        count = 2 if option == "-mm" else 1
        if option in _VECTORS:
            numeric = [_is_number(word) for word in words[:3]]
            count = numeric.index(False) if False in numeric else len(numeric)
        given, words = words[:count], words[count:]
        if option == "-clamp" and given == ["on"]:
            texture["wrap"] = "clamp"
        else:
            note(left_out, "texture options left out", Path(place).name)
    if not words:
        raise InputError(f"{place}: names no image; write map_Kd FILE")
    try:
        texture["texture"] = str(beside(path, " ".join(words), place))
    except InputError:
        note(left_out, "textures outside the folder of the mesh left out", Path(place).name)
        return None
    return texture


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
