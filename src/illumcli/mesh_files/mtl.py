"""Wavefront MTL: the material library of OBJ files, as keys of a scene's materials.

illum 0             the colour Kd, whatever the light
illum 1             Ka ambient + Kd n.l
illum 2 and above   Ka ambient + Kd n.l + Ks (n.h)^Ns, h half way between light and eye

This is `blinn_phong` as published: intensities, without 1/pi. Features without a counterpart (transparency,
reflection, refraction, factors and placement of textures) are counted, not approximated, and so are malformed
statements: a faulty library never refuses the mesh.

References
----------
Wavefront Technologies (1995). MTL material format, version 4.2. Ke, emission, is a later convention.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Any, TypeAlias

from illumcli.errors import IllumError
from illumcli.geometry.mesh import Substitute
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files._files import TAKEN, content, nearby
from illumcli.mesh_files._polygons import LARGEST
from illumcli.mesh_files._words import decoded, without_comment
from illumcli.records import Value

_COLORS = {"ka": "Ka", "kd": "Kd", "ks": "Ks", "ke": "Ke"}
_MAPS = ("bump", "disp", "decal", "refl", "norm")
_NUMBERS = {"ns": "Ns", "d": "d", "tr": "Tr", "illum": "illum"}
_NOTHING = {
    "ni",
    "tf",
    "sharpness",
}  # only for transparent and mirroring materials, which are counted as such

# options before the name of an image, with a word, two numbers, or one to three numbers
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?=\s)"
_OPTION = re.compile(
    rf"-(?:(?P<name>blendu|blendv|boost|bm|cc|clamp|imfchan|texres|type)\s+(?P<word>\S+)"
    rf"|mm(?:\s+{_NUMBER}){{1,2}}|[ost](?:\s+{_NUMBER}){{1,3}})(?:\s+|$)",
    re.IGNORECASE,
)

Color: TypeAlias = tuple[float, ...]
BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


class Library(Value):
    """The content of a library, by material name: keys of a scene's material, substitutes of textures."""

    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    substitutes: dict[str, dict[str, Substitute]] = field(default_factory=dict)
    repairs: dict[str, Repair] = field(default_factory=dict)
    looks: dict[str, Repair] = field(default_factory=dict)
    """Features that change the look of a material and are not supported; reported if the library is used."""


def read(path: Path, folder: Path) -> Library:
    """The materials of a library, and what was repaired or left out.

    Parameters
    ----------
    path : Path
        The library, inside `folder`.
    folder : Path
        The folder of the mesh, which contains the textures. Paths of textures begin with it.
    """
    library = Library()
    name = path.relative_to(folder).as_posix()
    try:
        lines = list(statements(content(path)))
    except IllumError:
        note(library.repairs, "material libraries that are empty or cannot be read", name)
        return library
    materials: dict[str, _Material] = {}
    current: _Material | None = None
    for number, word, rest in lines:
        place = f"{name}:{number}"
        if word == "newmtl":
            material_name = without_comment(rest).rstrip()
            if material_name in materials:
                note(library.repairs, "materials that are defined twice, joined", place)
            current = materials.setdefault(material_name, _Material(path, folder, library))
        elif current is None:
            note(library.repairs, "statements before any material left out", place)
        else:
            current.take(word, rest, place)
    for material, keys in materials.items():
        library.materials[material], library.substitutes[material] = keys.keys()
    return library


def statements(data: bytes) -> Iterator[tuple[int, str, str]]:
    """Line number, keyword in lower case and the rest of each statement."""
    lines = data.removeprefix(b"\xef\xbb\xbf").rstrip(b"\0\x1a").splitlines()
    for number, line in enumerate(lines, start=1):
        word, *rest = decoded(line).split(None, 1)[:2] or ("",)
        if word and not word.startswith("#"):
            yield number, word.lower(), rest[0].rstrip() if rest else ""


def is_map(word: str) -> bool:
    """True for statements that name an image."""
    return word.startswith("map_") or word in _MAPS


def images(path: Path, folder: Path) -> list[Path]:
    """The images that a library names and that exist; arguments as of `read`."""
    maps = [image_of(path, folder, rest) for _, word, rest in statements(content(path)) if is_map(word)]
    return list(dict.fromkeys(each.file for each in maps if each.file is not None))


class MapImage(Value):
    """The image of a map statement."""

    file: Path | None  # None if it is not there
    fault: str  # as from `nearby`
    is_clamped: bool
    has_options: bool  # options other than `-clamp on`


def image_of(library: Path, folder: Path, text: str) -> MapImage:
    """The image that a map statement of a library names, with options before the name."""
    # Options precede the name, which may contain blanks.
    at, is_clamped, has_options = 0, False, False
    while option := _OPTION.match(text, at):
        at = option.end()
        if (option["name"] or "").lower() == "clamp" and option["word"].lower() == "on":
            is_clamped = True
        else:
            has_options = True

    # The name as it is, otherwise without a comment, otherwise without quotes.
    name = text[at:]
    names = dict.fromkeys((name, without_comment(name).rstrip(), name.strip("\"'")))
    files = [nearby(library, each, folder) for each in names]
    file, fault = next((each for each in files if each[0]), files[0])
    return MapImage(file, fault, is_clamped, has_options)


class _Material:
    """Collects the statements of one material."""

    def __init__(self, path: Path, folder: Path, library: Library) -> None:
        self._path, self._folder = path, folder
        self._repairs, self._looks = library.repairs, library.looks
        self._values: dict[str, Any] = {}
        self._places: dict[str, str] = {}

    def take(self, word: str, rest: str, place: str) -> None:
        """Take a statement; a malformed one is left out and counted."""
        words = rest.partition("#")[0].split()
        if word in _COLORS:
            self._set(_COLORS[word], self._color(words, place), place)
        elif word in _NUMBERS:
            self._set(_NUMBERS[word], next(iter(self._numbers(words[-1:], place)), None), place)
        elif word == "map_kd":
            self._set("map_Kd", self._texture(rest, place), place)
        elif is_map(word):
            note(self._looks, "images of materials other than map_Kd left out", place)
        elif word not in _NOTHING:
            note(self._looks, "statements of materials that have no meaning here left out", place)

    def _set(self, key: str, value: Any, place: str) -> None:
        if value is not None:
            self._values[key], self._places[key] = value, place

    def _color(self, words: list[str], place: str) -> Color | None:
        if words[:1] and words[0].lower() in ("spectral", "xyz"):
            note(self._looks, "spectral and XYZ colours left out", place)
            return None
        values = self._numbers(words[:3], place)
        if len(values) == 2:
            note(self._repairs, "colours of two numbers, the first taken for all", place)
        return (values if len(values) == 3 else values[:1] * 3) or None

    def _numbers(self, words: list[str], place: str) -> Color:
        """The numbers; none if one is malformed or out of range."""
        try:
            values = tuple(map(float, words))
        except ValueError:
            values = ()
        if values and all(math.isfinite(value) and 0 <= value <= LARGEST for value in values):
            return values
        note(self._repairs, f"values of materials that are no numbers from 0 to {LARGEST:g} left out", place)
        return ()

    def _texture(self, text: str, place: str) -> dict[str, str] | None:
        """The texture of a map statement; None if there is no such file."""
        image = image_of(self._path, self._folder, text)
        if image.has_options:
            note(self._looks, "texture options left out", place)
        if image.fault:
            note(self._repairs, f"textures {image.fault} {TAKEN if image.file else 'left out'}", place)
        if image.file is None:
            return None
        return {"texture": str(image.file), **({"wrap": "clamp"} if image.is_clamped else {})}

    def keys(self) -> tuple[dict[str, Any], dict[str, Substitute]]:
        """The keys of a scene's material, and the substitutes of its textures."""
        # Count unsupported features.
        values, places = self._values, self._places
        diffuse = values.get("map_Kd", values.get("Kd"))
        if "map_Kd" in values and values.get("Kd", WHITE) != WHITE:
            note(self._looks, "factors Kd of a texture left out", places["Kd"])
        if values.get("d", 1 - values.get("Tr", 0.0)) < 1:
            note(self._repairs, "transparent materials made opaque", places["d" if "d" in values else "Tr"])
        illum = values.get("illum", 2.0)
        if illum > 2:
            note(self._looks, "reflection of materials left out", places["illum"])

        # The parameters, by the lighting mode.
        if illum == 0:
            light = WHITE if diffuse is None else diffuse
            keys = {"diffuse": BLACK, "specular": BLACK, "ambient": BLACK, "emission": light}
        else:
            keys = {
                "diffuse": diffuse,
                "specular": values.get("Ks", BLACK) if illum >= 2 else BLACK,
                "exponent": values.get("Ns"),
                "emission": values.get("Ke"),
                "ambient": values.get("Ka"),
            }
        given = {key: value for key, value in keys.items() if value is not None}
        substitute = Substitute(values.get("Kd", WHITE), places.get("map_Kd", ""))
        textured = {key: substitute for key, value in given.items() if isinstance(value, dict)}
        return {"model": "blinn_phong", **given}, textured
