"""Draws the distributions of facet normals of scenes/satin.yaml and scenes/grooves.yaml.

Drawings in the plane of slopes: the centre is a flat facet, to the right facets lean along the grain, upwards
across it. A pixel's number is the share of the surface that leans so.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

FOLDER = Path(__file__).parents[1] / "scenes" / "facets"
SIDE = 128

x, y = np.meshgrid((np.arange(SIDE) + 0.5) * 2 / SIDE - 1, 1 - (np.arange(SIDE) + 0.5) * 2 / SIDE)


def spot(at: tuple[float, float], width: tuple[float, float]) -> NDArray[np.float64]:
    """A soft spot; places and widths as shares of half the image."""
    return np.exp(-(((x - at[0]) / width[0]) ** 2) - ((y - at[1]) / width[1]) ** 2)


def soft(distance: NDArray[np.float64], edge: float) -> NDArray[np.float64]:
    """1 inside, where the distance is below 0, and 0 outside of a soft edge."""
    return np.clip(0.5 - distance / edge, 0, 1)


def satin() -> NDArray[np.float64]:
    """Floating threads, one colour to either side: a golden and a rose ridge, each with a wide soft foot."""
    gold, rose = np.array([1.0, 0.72, 0.28]), np.array([0.95, 0.2, 0.3])
    ridges = sum(
        (spot((0, at), (0.5, 0.09)) + 0.18 * spot((0, at), (0.7, 0.3)))[..., None] * color
        for at, color in ((0.3, gold), (-0.3, rose))
    )
    return ridges * ((1 - x * x) * (1 - y * y))[..., None]  # black at the border, which would show as an edge


def v_grooves() -> NDArray[np.float64]:
    """Two flanks, of 27 degrees."""
    return spot((0, 0.5), (0.1, 0.06)) + spot((0, -0.5), (0.1, 0.06))


def round_grooves() -> NDArray[np.float64]:
    """Half tubes to 37 degrees: sin of the angle is even, so the lean has the density (1 + y^2)^(-3/2)."""
    return spot((0, 0), (0.1, 9)) * (1 + y * y) ** -1.5 * soft(np.abs(y) - 0.75, 0.06)


def flat_grooves() -> NDArray[np.float64]:
    """Flat floors and tops between steep flanks, as of a milled plate."""
    return spot((0, 0), (0.1, 0.06)) + 0.45 * (spot((0, 0.7), (0.1, 0.06)) + spot((0, -0.7), (0.1, 0.06)))


def saw_grooves() -> NDArray[np.float64]:
    """Long gentle flanks one way and short steep ones back; weighted by their leans they are level."""
    return spot((0, 0.2), (0.1, 0.06)) + 0.25 * spot((0, -0.8), (0.1, 0.06))


def write(name: str, picture: NDArray[np.float64]) -> None:
    """A 16-bit PNG of the brightest at its largest number: 8 bits show as bands in soft feet."""
    pixels = np.round(picture / picture.max() * 65535).astype(np.uint16)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    out = oiio.ImageOutput.create(str(FOLDER / name))
    out.open(str(FOLDER / name), oiio.ImageSpec(*pixels.shape[1::-1], pixels.shape[2], "uint16"))
    out.write_image(np.ascontiguousarray(pixels))
    out.close()


if __name__ == "__main__":
    for draw in (satin, v_grooves, round_grooves, flat_grooves, saw_grooves):
        write(f"{draw.__name__}.png", draw())
