"""Fresnel reflectance: formulas that several models share, and their descriptions in scenes.

c is the cosine between the light and the *facet's* normal, l.h = v.h; texts that print n.l mean a mirror.
Every function works element by element on arrays that broadcast, in their precision.

References
----------
Cook, R. L., Torrance, K. E. (1982). A reflectance model for computer graphics. ACM Trans. Graph. 1(1).
Schlick, C. (1994). An inexpensive BRDF model for physically-based rendering. Computer Graphics Forum 13(3).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._lobes import channels, fifth
from illumcli.models._parameters import ExtinctionColor, Index, IndexColor, Varying
from illumcli.schema.description import Description
from illumcli.schema.fields import Albedo

Array: TypeAlias = NDArray[np.floating[Any]]


def dielectric(c: Array, eta: Array) -> Array:
    """Reflectance of a dielectric boundary for unpolarised light, 0..1; 1 at total internal reflection.

    g^2 = eta^2 + c^2 - 1; Cook and Torrance's fraction, with (g - c) / (g + c) = (eta^2 - 1) / (g + c)^2 and
    c (g -+ c) +- 1 = c g +- (1 - c^2), which are accurate for eta near 1 and c near 0. If g^2 < 0, both
    quotients are clamped to -1: total reflection.

    Parameters
    ----------
    c : float array
        Cosine at the facet, 0..1.
    eta : float array
        Index behind the boundary over the index before it.
    """
    q0 = (eta - 1) * (eta + 1)
    g = np.sqrt(np.maximum(q0 + c * c, 0))
    sin2, cg = (1 - c) * (1 + c), c * g
    tiny = np.finfo(g.dtype).tiny
    rs = np.clip(q0 / np.maximum(np.square(g + c), tiny), -1, 1)
    ratio = (cg - sin2) / np.maximum(cg + sin2, tiny)
    return rs * rs * (1 + ratio * ratio) / 2


def conductor(c: Array, eta: Array, k: Array) -> Array:
    """Reflectance of a metal for unpolarised light, 0..1; k = 0 is the dielectric.

    In real arithmetic, with q = sqrt((eta + ik)^2 - 1 + c^2), |r_s| = |eps - 1| / |c + q|^2 and
    |r_p / r_s| = |c q - (1 - c^2)| / |c q + (1 - c^2)|. The sign of k does not matter.

    Parameters
    ----------
    c : float array
        Cosine at the facet, 0..1.
    eta, k : float arrays
        Real and imaginary part of the index.
    """
    re0, im = (eta - 1) * (eta + 1) - k * k, 2 * eta * k
    re = re0 + c * c
    large = np.sqrt((np.sqrt(re * re + im * im) + np.abs(re)) / 2)
    tiny = np.finfo(large.dtype).tiny
    small = im / (2 * np.maximum(large, tiny))
    clear, dense = re >= 0, re < 0
    q_re, q_im = large * clear + small * dense, small * clear + large * dense
    sin2 = (1 - c) * (1 + c)
    rs2 = (re0 * re0 + im * im) / np.maximum(np.square(np.square(c + q_re) + q_im * q_im), tiny)
    a, b, d = c * q_re - sin2, c * q_re + sin2, np.square(c * q_im)
    return np.minimum(rs2 * (1 + (a * a + d) / np.maximum(b * b + d, tiny)) / 2, 1)


def schlick(c: Array, f0: Array) -> Array:
    """Schlick's approximation f0 + (1 - f0) (1 - c)^5; exact at c = 1 and c = 0."""
    return f0 + (1 - f0) * fifth(1 - c)


def f0_from_eta(eta: Array, k: Array | float = 0.0) -> Array:
    """Reflectance at normal incidence, ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2)."""
    k2 = k * k
    return (np.square(eta - 1) + k2) / (np.square(eta + 1) + k2)


def eta_from_f0(f0: Array) -> Array:
    """The index >= 1 of a dielectric that reflects f0 < 1 at normal incidence; a metal has no such index."""
    return np.square(1 + np.sqrt(f0)) / (1 - f0)


def color_shift(c: Array, eta: Array, color0: Array, color90: Array) -> Array:
    """Cook and Torrance's colour between `color0` at normal incidence and `color90` at grazing.

    It replaces F; texts that multiply it by F again apply Fresnel twice, and one text swaps the colours.
    """
    t = (dielectric(c, eta) - f0_from_eta(eta)) * (np.square(1 + eta) / (4 * eta))
    return color0 + (color90 - color0) * np.clip(t, 0, 1)


MATERIALS: dict[str, tuple[float, float, float]] = {
    "water": (0.02, 0.02, 0.02),
    "plastic": (0.05, 0.05, 0.05),
    "glass": (0.08, 0.08, 0.08),
    "diamond": (0.17, 0.17, 0.17),
    "copper": (0.95, 0.64, 0.54),
    "aluminium": (0.91, 0.92, 0.92),
}
"""Reflectance at normal incidence, linear R, G, B. `glass` is a dense flint; crown glass (1.5) has 0.04."""


class Dielectric(Description):
    """A dielectric boundary: glass, water, plastic, lacquer."""

    F: Literal["dielectric"] = "dielectric"
    ior: Varying[Index] = 1.5
    """eta, index of refraction behind the surface over that before it; below 1, reflection may be total."""

    def reflectance(self, c: Floats, light: Vectors | None = None) -> Array:
        """(N,) at the cosine c."""
        (eta,) = as_dtype_of(c, self.ior)
        return dielectric(c, eta)


class Conductor(Description):
    """A metal, by its complex index in each channel."""

    F: Literal["conductor"] = "conductor"
    n: Varying[IndexColor] = (0.2, 0.92, 1.1)
    """eta, real part of the index per channel."""
    k: Varying[ExtinctionColor] = (3.9, 2.45, 2.14)
    """k, imaginary part of the index per channel."""

    def reflectance(self, c: Floats, light: Vectors | None = None) -> Array:
        """(3, N) at the cosine c."""
        return conductor(c, channels(c, self.n), channels(c, self.k))


class Schlick(Description):
    """Schlick's curve from the reflectance at normal incidence."""

    F: Literal["schlick"] = "schlick"
    f0: Varying[Albedo] = (0.04, 0.04, 0.04)
    """F0, reflectance at normal incidence per channel."""

    def reflectance(self, c: Floats, light: Vectors | None = None) -> Array:
        """(3, N) at the cosine c."""
        return schlick(c, channels(c, self.f0))


class Material(Description):
    """A material by name, from the table of its reflectance at normal incidence."""

    F: Literal["material"] = "material"
    name: Literal["water", "plastic", "glass", "diamond", "copper", "aluminium"] = "plastic"
    """Name of the material, with its F0. `water`: 0.02. `plastic`: 0.05. `glass`: 0.08, dense flint.
    `diamond`: 0.17. `copper`: 0.95, 0.64, 0.54. `aluminium`: 0.91, 0.92, 0.92."""
    curve: Literal["dielectric", "schlick"] = "dielectric"
    """Reflectance between normal incidence and grazing. `dielectric`: by the index that F0 implies with k =
    0, which for metals is fictitious. `schlick`: by Schlick's curve."""

    def reflectance(self, c: Floats, light: Vectors | None = None) -> Array:
        """(3, N) at the cosine c."""
        f0 = channels(c, MATERIALS[self.name])
        return schlick(c, f0) if self.curve == "schlick" else dielectric(c, eta_from_f0(f0))


class Shifted(Description):
    """Cook and Torrance's colour shift, from the material's colour at the normal to white or the light's."""

    F: Literal["shifted"] = "shifted"
    color: Varying[Albedo] = (0.95, 0.64, 0.54)
    """Colour of the reflection at normal incidence under white light; replaces F0."""
    ior: Varying[Index] = 10.0
    """eta, the average index; it determines how fast the colour shifts."""
    grazing: Literal["white", "light"] = "white"
    """Colour at grazing. `white`: the reflection has the light's colour. `light`: the wording of the text
    taken literally, which applies the light's colour twice."""

    def reflectance(self, c: Floats, light: Vectors | None = None) -> Array:
        """(3, N) at the cosine c; `light` is the light's colour, largest component 1."""
        (eta,) = as_dtype_of(c, self.ior)
        grazing = channels(c, (1.0, 1.0, 1.0) if light is None else light)
        return color_shift(c, eta, channels(c, self.color), grazing)


class Constant(Description):
    """The same reflectance at every angle."""

    F: Literal["constant"] = "constant"
    value: Varying[Albedo] = (1.0, 1.0, 1.0)
    """F per channel; 1 is a perfect mirror in every facet."""

    def reflectance(self, c: Floats, light: Vectors | None = None) -> Array:
        """(3, 1) whatever c."""
        return channels(c, self.value)


Fresnel: TypeAlias = Annotated[
    Dielectric | Conductor | Schlick | Material | Shifted | Constant, Discriminator("F")
]
