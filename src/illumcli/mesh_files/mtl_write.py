"""Writes Wavefront MTL: a scene's materials, as mesh files have them, as intensities of Blinn-Phong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

Keys = Mapping[str, Any]
Name = Callable[[str], str]
"""A texture of a material -> the name that the library has for it."""


def mtl_lines(materials: Mapping[str, Keys], image: Name) -> Iterator[str]:
    """The lines of a library.

    `Kd` is the diffuse colour, or the base colour of a metallic-roughness material; `Ks` the specular colour,
    or the reflectance at normal incidence; `Ns` the exponent, or that of the lobe of equal width, 2 / alpha^2
    - 2. `Pr` and `Pm`, for readers that know them, are roughness, the square root of alpha, and metallic.

    Parameters
    ----------
    image
        Function of a texture of a material: the name that the library has for it.
    """
    for name, keys in materials.items():
        yield f"newmtl {' '.join(name.split())}"
        yield from _LINES.get(keys.get("model"), _blinn_phong)(keys, image)
        if keys.get("emission"):
            yield from _color("Ke", keys["emission"], image)
        yield "illum 2"


def left_out(materials: Mapping[str, Keys]) -> list[str]:
    """What a library has no place for."""
    numbers = (keys.get(name) for keys in materials.values() for name in ("metallic", "roughness"))
    return ["textures of metal and roughness"] if any(isinstance(each, Mapping) for each in numbers) else []


def _blinn_phong(keys: Keys, image: Name) -> Iterator[str]:
    yield from _color("Kd", keys.get("diffuse", (0.8, 0.8, 0.8)), image)
    yield from _color("Ks", keys.get("specular", (0.0, 0.0, 0.0)), image)
    if keys.get("exponent") is not None:
        yield f"Ns {keys['exponent']:.6g}"


def _cook_torrance(keys: Keys, image: Name) -> Iterator[str]:
    yield from _color("Kd", keys["ambient"], image)
    yield from _color("Ks", keys["fresnel"]["f0"], image)
    yield from _width(float(keys["distribution"]["alpha"]))


def _metallic_roughness(keys: Keys, image: Name) -> Iterator[str]:
    base, metallic, roughness = keys["base_color"], keys["metallic"], keys["roughness"]
    metallic = 0.0 if isinstance(metallic, Mapping) else metallic
    roughness = roughness.get("factor", (1.0,))[0] if isinstance(roughness, Mapping) else roughness
    yield from _color("Kd", base, image)

    # The reflectance at normal incidence of the mixture; where the base colour varies, of what prevails.
    ior = keys.get("ior", 1.5)
    dielectric = ((ior - 1) / (ior + 1)) ** 2
    if not isinstance(base, Mapping):
        yield from _color("Ks", [dielectric + metallic * (each - dielectric) for each in base], image)
    else:
        yield from _color("Ks", base if metallic > 0.5 else (dielectric,) * 3, image)
    yield from _width(max(roughness**2, 1e-4))
    yield f"Pm {metallic:.6g}"


def _width(alpha: float) -> Iterator[str]:
    yield f"Ns {max(2 / alpha**2 - 2, 0):.6g}"
    yield f"Pr {alpha**0.5:.6g}"


_LINES: Mapping[Any, Callable[[Keys, Name], Iterator[str]]] = {
    "cook_torrance": _cook_torrance,
    "metallic_roughness": _metallic_roughness,
}


def _color(word: str, value: Any, image: Name) -> Iterator[str]:
    """A colour, and the texture that it multiplies."""
    factor = value.get("factor", (1.0, 1.0, 1.0)) if isinstance(value, Mapping) else value
    yield f"{word} {' '.join(f'{each:.6g}' for each in factor)}"
    if isinstance(value, Mapping) and "texture" in value:
        clamp = "-clamp on " if value.get("wrap") == "clamp" else ""
        yield f"map_{word} {clamp}{image(value['texture'])}"
