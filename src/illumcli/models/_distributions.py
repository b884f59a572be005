"""Distributions of facet normals as scenes describe them: D, and the areas that Smith's masking needs.

The formulas are those of `_microfacet` and `_masking`. Areas are those of the normalised D, whatever
convention D itself has. Beckmann and GGX have them in closed form and may be anisotropic; the others' are
integrated.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Discriminator, Field

from illumcli.arrays import Floats, as_dtype_of
from illumcli.models._masking import (
    NEGLIGIBLE,
    Extent,
    FacetArea,
    anisotropic_spread2,
    beckmann_area,
    ggx_area,
    integrated_area,
    isotropic_spread2,
)
from illumcli.models._microfacet import (
    alpha_of_half_height,
    anisotropic_beckmann,
    anisotropic_ggx,
    beckmann,
    gaussian,
    gaussian_constant,
    ggx,
    gtr,
    gtr_height,
    m_of_half_height,
    power_cosine,
    power_of_half_height,
    squared_unit,
)
from illumcli.models._parameters import HalfHeight, Roughness, Varying
from illumcli.models._terms import Angle, Components
from illumcli.schema.description import Description
from illumcli.schema.fields import NonNegative, Positive


class Gaussian(Description):
    """Torrance and Sparrow's Gaussian of the angle, by its width."""

    D: Literal["gaussian"] = "gaussian"
    m: Varying[Roughness] = 0.3
    """m, angle in radians at which D has fallen to 1/e."""
    c: Varying[Positive] | None = None
    """c, height at the normal [1/sr]; by default the c that normalises D."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) c exp(-(theta / m)^2)."""
        height = gaussian_constant(np.asarray(self.m)) if self.c is None else self.c
        m, c = as_dtype_of(theta.cosine, self.m, height)
        return c * gaussian(*theta, m)

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        return gaussian_area(cosine, self.m)


class Beckmann(Description):
    """Beckmann's distribution of a surface with Gaussian slopes."""

    D: Literal["beckmann"] = "beckmann"
    m: Varying[Roughness] = 0.3
    """m, RMS slope: 0.05 polished, 1 very rough."""
    m_y: Varying[Roughness] | None = None
    """RMS slope across the grain, m being the one along it; by default m, which is isotropic."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) normalised; printed with 1 / (m^2 cos^4), pi times that."""
        (m,) = as_dtype_of(theta.cosine, self.m)
        density = beckmann(*theta, m)
        return density * np.pi if printed else density

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        (m,) = as_dtype_of(cosine, self.m)
        return beckmann_area(cosine, isotropic_spread2(cosine, m))

    def grain_density(self, s: Components, printed: bool = False) -> Floats:
        """(N,) the same with m_y; s is the half vector, of any length."""
        m_x, m_y = as_dtype_of(s.n, self.m, self.m_y)
        density = anisotropic_beckmann(squared_unit(s), m_x, m_y)
        return density * np.pi if printed else density

    def grain_area(self, x: Components) -> FacetArea:
        """What direction x sees, with m_y."""
        m_x, m_y = as_dtype_of(x.n, self.m, self.m_y)
        return beckmann_area(x.n, anisotropic_spread2(x.t, x.b, m_x, m_y))


class Blinn(Description):
    """Blinn's power of the cosine, by its half-height angle."""

    D: Literal["blinn"] = "blinn"
    beta: Varying[HalfHeight] = 0.3
    """beta, angle in radians at which D is half its height."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) normalised; printed with height 1."""
        (exponent,) = as_dtype_of(theta.cosine, power_of_half_height(np.asarray(self.beta)))
        height = 1 if printed else (exponent + 2) / (2 * np.pi)
        return power_cosine(*theta, exponent) * height

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        return power_area(cosine, power_of_half_height(np.asarray(self.beta)))


class PowerCosine(Description):
    """Blinn's power of the cosine, by its exponent; about 2 / m^2 - 2 matches Beckmann."""

    D: Literal["power"] = "power"
    exponent: Varying[NonNegative] = 20.0
    """n, the exponent; 0 to 10^6 and beyond."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) (n + 2) / (2 pi) cos^n, normalised."""
        (exponent,) = as_dtype_of(theta.cosine, self.exponent)
        return power_cosine(*theta, exponent) * ((exponent + 2) / (2 * np.pi))

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        return power_area(cosine, self.exponent)


class TorranceSparrow(Description):
    """Torrance and Sparrow's Gaussian of the angle, by its half-height angle."""

    D: Literal["torrance_sparrow"] = "torrance_sparrow"
    beta: Varying[HalfHeight] = 0.3
    """beta, angle in radians at which D is half its height."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) normalised; printed with height 1."""
        width = m_of_half_height(np.asarray(self.beta))
        m, c = as_dtype_of(theta.cosine, width, 1 if printed else gaussian_constant(width))
        return c * gaussian(*theta, m)

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        return gaussian_area(cosine, m_of_half_height(np.asarray(self.beta)))


class TrowbridgeReitz(Description):
    """Trowbridge and Reitz's ellipsoids, by their half-height angle."""

    D: Literal["trowbridge_reitz"] = "trowbridge_reitz"
    beta: Varying[HalfHeight] = 0.3
    """beta, angle in radians at which D is half its height."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) normalised; printed with height 1."""
        (alpha,) = as_dtype_of(theta.cosine, alpha_of_half_height(np.asarray(self.beta)))
        density = ggx(*theta, alpha)
        return density * (np.pi * np.square(alpha)) if printed else density

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        (alpha,) = as_dtype_of(cosine, alpha_of_half_height(np.asarray(self.beta)))
        return ggx_area(cosine, isotropic_spread2(cosine, alpha))


class GGX(Description):
    """Walter's GGX: Trowbridge and Reitz by roughness."""

    D: Literal["ggx"] = "ggx"
    alpha: Varying[Roughness] = 0.3
    """alpha, slope scale: 0.05 polished, 1 very rough; longer tails than Beckmann."""
    alpha_y: Varying[Roughness] | None = None
    """Slope scale across the grain, alpha being the one along it; by default alpha, which is isotropic."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) normalised."""
        (alpha,) = as_dtype_of(theta.cosine, self.alpha)
        return ggx(*theta, alpha)

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        (alpha,) = as_dtype_of(cosine, self.alpha)
        return ggx_area(cosine, isotropic_spread2(cosine, alpha))

    def grain_density(self, s: Components, printed: bool = False) -> Floats:
        """(N,) normalised, with alpha_y; s is the half vector, of any length."""
        alpha_x, alpha_y = as_dtype_of(s.n, self.alpha, self.alpha_y)
        return anisotropic_ggx(squared_unit(s), alpha_x, alpha_y)

    def grain_area(self, x: Components) -> FacetArea:
        """What direction x sees, with alpha_y."""
        alpha_x, alpha_y = as_dtype_of(x.n, self.alpha, self.alpha_y)
        return ggx_area(x.n, anisotropic_spread2(x.t, x.b, alpha_x, alpha_y))


class GTR(Description):
    """Burley's generalised Trowbridge-Reitz: the tails' length is a parameter."""

    D: Literal["gtr"] = "gtr"
    alpha: Varying[Annotated[float, Field(ge=1e-4, le=1)]] = 0.3
    """alpha, slope scale: 0.05 polished, 1 uniform."""
    gamma: Varying[Annotated[float, Field(gt=0, le=10)]] = 1.5
    """gamma, exponent: 1 Berry's, with very long tails, 2 GGX, 10 almost Beckmann's of m^2 = alpha^2 / 10."""

    def density(self, theta: Angle, printed: bool = False) -> Floats:
        """(N,) normalised."""
        height = gtr_height(np.asarray(self.alpha), np.asarray(self.gamma))
        alpha, gamma, height = as_dtype_of(theta.cosine, self.alpha, self.gamma, height)
        return height * gtr(theta.sin2, alpha, gamma)

    def area(self, cosine: Floats) -> FacetArea:
        """What a direction at this cosine to the normal sees."""
        height = gtr_height(np.asarray(self.alpha), np.asarray(self.gamma))
        alpha, gamma, height = as_dtype_of(cosine, self.alpha, self.gamma, height)
        # with tails as long as GGX's, all angles count
        fall = NEGLIGIBLE[cosine.dtype] / np.maximum(2 * gamma - 3, 1e-3)
        end = np.exp(np.minimum(np.log(alpha) + fall, 0))
        extent = Extent(alpha / np.sqrt(np.maximum(gamma, 1)), np.square(end))
        return integrated_area(cosine, lambda theta: gtr(theta.sin2, alpha, gamma), extent, height)


Distribution: TypeAlias = Annotated[
    Gaussian | Beckmann | Blinn | PowerCosine | TorranceSparrow | TrowbridgeReitz | GGX | GTR,
    Discriminator("D"),
]


def slopes_with_grain(distribution: Distribution) -> tuple[Any, Any] | None:
    """Roughness along the grain and across it; None if the distribution has no parameter across it."""
    match distribution:
        case Beckmann(m=along, m_y=across) | GGX(alpha=along, alpha_y=across) if across is not None:
            return along, across
    return None


def gaussian_area(cosine: Floats, m: Any) -> FacetArea:
    """Areas of the normalised Gaussian of the angle."""
    width, height = as_dtype_of(cosine, m, gaussian_constant(np.asarray(m)))
    end = np.minimum(width * sqrt(NEGLIGIBLE[cosine.dtype]), np.pi / 2)
    extent = Extent(width, np.square(np.sin(end)))
    return integrated_area(cosine, lambda theta: gaussian(*theta, width), extent, height)


def power_area(cosine: Floats, exponent: Any) -> FacetArea:
    """Areas of the normalised power of the cosine."""
    (n,) = as_dtype_of(cosine, exponent)
    end2 = -np.expm1(-2 * NEGLIGIBLE[cosine.dtype] / np.maximum(n, 1e-3))
    extent = Extent(np.sqrt(2 / (n + 2)), end2)
    return integrated_area(cosine, lambda theta: power_cosine(*theta, n), extent, (n + 2) / (2 * np.pi))
