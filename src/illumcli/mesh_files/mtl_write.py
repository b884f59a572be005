"""Writes Wavefront MTL: a scene's materials, as mesh files have them, as intensities of Blinn-Phong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

Keys = Mapping[str, Any]


def mtl_lines(materials: Mapping[str, Keys], image: Callable[[str], str]) -> Iterator[str]:
    """The lines of a library.

    `Kd` is the diffuse colour, or the base colour of a metallic-roughness material; `Ks` the specular colour,
    or the reflectance at normal incidence; `Ns` the exponent, or that of the lobe of equal width, 2 / alpha^2
    - 2; `Pr`, for readers that know it, the square root of alpha.

    Parameters
    ----------
    image
        Function of a texture of a material: the name that the library has for it.
    """
    for name, keys in materials.items():
        yield f"newmtl {' '.join(name.split())}"
        is_measured = keys.get("model") == "cook_torrance"
        base = keys.get("ambient" if is_measured else "diffuse", (0.8, 0.8, 0.8))
        yield from _color("Kd", base, image)
        if is_measured:
            alpha = float(keys["distribution"]["alpha"])
            yield from _color("Ks", keys["fresnel"]["f0"], image)
            yield f"Ns {max(2 / alpha**2 - 2, 0):.6g}"
            yield f"Pr {alpha**0.5:.6g}"
        else:
            yield from _color("Ks", keys.get("specular", (0.0, 0.0, 0.0)), image)
            if keys.get("exponent") is not None:
                yield f"Ns {keys['exponent']:.6g}"
        if keys.get("emission"):
            yield from _color("Ke", keys["emission"], image)
        yield "illum 2"


def _color(word: str, value: Any, image: Callable[[str], str]) -> Iterator[str]:
    """A colour, and the texture that it multiplies."""
    factor = value.get("factor", (1.0, 1.0, 1.0)) if isinstance(value, Mapping) else value
    yield f"{word} {' '.join(f'{each:.6g}' for each in factor)}"
    if isinstance(value, Mapping) and "texture" in value:
        clamp = "-clamp on " if value.get("wrap") == "clamp" else ""
        yield f"map_{word} {clamp}{image(value['texture'])}"
