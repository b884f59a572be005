"""Linear light to the integers of a picture file: exposure, sRGB transfer curve, rounding."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.color import from_srgb, to_srgb
from illumcli.film.finite import refuse_nonfinite

NAMES = {1: ("Y",), 2: ("Y", "A"), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}


def picture(
    band: NDArray[np.float32],
    exposure: float = 0.0,
    bits: int = 8,
    place: str = "picture",
    y0: int = 0,
    x0: int = 0,
) -> NDArray[np.unsignedinteger[Any]]:
    """(h, W, C) uint8, or uint16 for 16 bits: `band` as a PNG stores it.

    Light is exposed, clipped to 0..1, encoded by the sRGB curve and rounded to the nearest step. Alpha is
    rounded without the curve, and colour is divided by it: a PNG is not premultiplied.

    Parameters
    ----------
    band : (h, W, C) float32
        Linear; C is 1 (Y), 2 (Y A), 3 (R G B) or 4 (R G B A), premultiplied if there is an alpha.
    exposure : float
        Light is multiplied by 2**exposure [stops].
    place, y0, x0
        Name of the picture and numbers of the band's first row and column, for the error.

    Raises
    ------
    IllumError
        NaN or Inf in `band`.
    """
    names = NAMES[band.shape[-1]]
    refuse_nonfinite(band, names, place, y0, x0)
    encode = srgb8 if bits == 8 else srgb16
    out = np.empty(band.shape, np.uint8 if bits == 8 else np.uint16)
    color = band
    if names[-1] == "A":
        alpha = np.clip(band[..., -1:], 0, 1)
        color = unpremultiplied(band[..., :-1], alpha)
        out[..., -1] = np.rint(alpha[..., 0] * np.iinfo(out.dtype).max)
    light = exposed(color, exposure)
    for c in range(light.shape[-1]):  # layers are kept channel by channel
        out[..., c] = encode(light[..., c])
    return out


def plain(band: NDArray[np.float32], place: str = "picture", y0: int = 0, x0: int = 0) -> NDArray[np.uint8]:
    """(h, W, C) uint8: numbers 0..1 in a PNG that is not a picture of light, round(255 v).

    Raises
    ------
    IllumError
        NaN or Inf in `band`.
    """
    refuse_nonfinite(band, NAMES[band.shape[-1]], place, y0, x0)
    return np.rint(np.clip(band, 0, 1) * 255).astype(np.uint8)


def exposed(linear: NDArray[np.float32], stops: float) -> NDArray[np.float32]:
    """`linear` times 2**stops; exact for whole stops, infinite beyond float32."""
    with np.errstate(over="ignore"):
        return linear if stops == 0 else linear * np.float32(2.0**stops)


def unpremultiplied(color: NDArray[np.float32], alpha: NDArray[np.float32]) -> NDArray[np.float32]:
    """`color` / `alpha`, the colour of the covered part; `color` itself where nothing is covered."""
    if not ((alpha > 0) & (alpha < 1)).any():  # the division takes longer than everything else here
        return color
    with np.errstate(over="ignore"):
        return np.divide(color, alpha, out=color.copy(), where=alpha > 0)


def srgb8(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """round(255 sRGB(linear)), exactly, clipped to 0..255; the same on every machine.

    The upper half of a float32 holds its sign, exponent and 7 bits of its fraction. For each of these 65536
    intervals a table has the step at its lower end. No interval contains more than one border between steps,
    so one comparison with the next border is enough.
    """
    steps, borders = _tables()
    linear = np.ascontiguousarray(linear, np.float32)
    interval = (linear.view(np.uint32) >> 16).astype(np.intp)
    return steps.take(interval, mode="wrap") + (linear >= borders.take(interval, mode="wrap"))


def srgb16(linear: NDArray[np.float32]) -> NDArray[np.uint16]:
    """round(65535 sRGB(linear)), clipped to 0..65535."""
    return np.rint(to_srgb(np.clip(linear, 0, 1).astype(np.float64)) * 65535).astype(np.uint16)


@cache
def _tables() -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """(65536,) step at the lower end of each interval, and the smallest float32 of the step after it."""
    exact = from_srgb((np.arange(1, 256) - 0.5) / 255)
    near = exact.astype(np.float32)
    borders = np.where(near < exact, np.nextafter(near, np.float32(np.inf)), near)
    ends = (np.arange(65536, dtype=np.uint32) << 16).view(np.float32)
    steps = np.searchsorted(borders, np.fmax(ends, 0), side="right").astype(np.uint8)
    return steps, np.append(borders, np.float32(np.nan)).take(steps)  # there is no step after 255
