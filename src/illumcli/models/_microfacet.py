"""Facet distributions D and the V-groove term G: formulas.

theta is the angle between the normal and the half vector. Distributions take its cosine `n_h` (above 0) and
`sin2_h` = sin^2, so that narrow lobes are accurate near the normal and wide ones at grazing. The angle itself
is computed only if a formula has it. Every function works element by element.

A *normalised* D satisfies: the integral of D cos(theta) over the hemisphere is 1. [1/sr]

References
----------
Beckmann, P., Spizzichino, A. (1963). The scattering of electromagnetic waves from rough surfaces.
Torrance, K. E., Sparrow, E. M. (1967). Theory for off-specular reflection from roughened surfaces. JOSA 57.
Trowbridge, T. S., Reitz, K. P. (1975). Average irregularity representation of a rough surface. JOSA 65(5).
Blinn, J. F. (1977). Models of light reflection for computer synthesized pictures. SIGGRAPH '77.
Walter, B., et al. (2007). Microfacet models for refraction through rough surfaces. EGSR '07, eq. 25, 33.
Burley, B. (2012). Physically-based shading at Disney. SIGGRAPH 2012 course, appendix B: the generalised form.
Heitz, E. (2014). Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2).
"""

from __future__ import annotations

import numpy as np

from illumcli.arrays import Floats
from illumcli.models._lobes import gauss_legendre, log_cos
from illumcli.models._terms import Components


def gaussian(n_h: Floats, sin2_h: Floats, m: Floats) -> Floats:
    """exp(-(theta / m)^2), 1 at the normal; `gaussian_constant(m)` times this is normalised."""
    return np.exp(-np.square(np.arctan2(np.sqrt(sin2_h), n_h) / m))


def gaussian_constant(m: Floats) -> Floats:
    """The c that normalises c exp(-(theta / m)^2), in float64; near 1 / (pi m^2) for small m.

    1 / c = pi times the integral of exp(-(theta / m)^2) sin(2 theta) over 0..pi/2.
    """
    m = np.asarray(m, np.float64)
    end = np.minimum(np.pi / 2, 7 * m)
    area = np.zeros_like(m)
    for node, weight in gauss_legendre(48):
        theta = end * (1 + node) / 2
        area = area + weight * np.exp(-np.square(theta / m)) * np.sin(2 * theta)
    return 2 / (np.pi * end * area)


def beckmann(n_h: Floats, sin2_h: Floats, m: Floats) -> Floats:
    """exp(-tan^2 / m^2) / (pi m^2 cos^4), normalised; m is the RMS slope.

    1 / cos^4 is computed as (1 + tan^2)^2, which is finite wherever the exponential is not 0.
    """
    tan2 = sin2_h / np.square(n_h)
    return np.exp(-tan2 / np.square(m)) * np.square((1 + tan2) / m) / np.pi


def beckmann_slope1d(n_h: Floats, sin2_h: Floats, m: Floats) -> Floats:
    """exp(-tan^2 / m^2) / (sqrt(pi) m cos^2): density of one profile's slope angle.

    One text prints m^2 in place of m; the integral of that is 1 / m.
    """
    tan2 = sin2_h / np.square(n_h)
    return np.exp(-tan2 / np.square(m)) * (1 + tan2) / (np.sqrt(np.pi) * m)


def power_cosine(n_h: Floats, sin2_h: Floats, exponent: Floats) -> Floats:
    """cos(theta)^exponent, 1 at the normal; (exponent + 2) / (2 pi) times this is normalised."""
    return np.exp(exponent * log_cos(n_h, sin2_h))


def ggx(n_h: Floats, sin2_h: Floats, alpha: Floats) -> Floats:
    """alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2), normalised."""
    wide = np.square(alpha * n_h) + sin2_h
    return np.square(alpha / wide) / np.pi


def gtr(sin2_h: Floats, alpha: Floats, gamma: Floats) -> Floats:
    """(alpha^2 / (alpha^2 cos^2 + sin^2))^gamma, 1 at the normal; `gtr_height` times this is normalised."""
    return np.exp(-gamma * np.log1p(sin2_h * ((1 - alpha) * (1 + alpha) / np.square(alpha))))


def gtr_height(alpha: Floats, gamma: Floats) -> Floats:
    """The height at the normal that normalises `gtr`, in float64: 1 / (pi alpha^2) for a gamma of 2.

    With x = -2 ln alpha and f(x) = (e^x - 1) / x, it is f(x) / (pi f((1 - gamma) x)): Burley's constants for
    gamma = 1 and for others in one form, which has no poles.
    """
    x = -2 * np.log(np.asarray(alpha, np.float64))
    return _exprel(x) / (np.pi * _exprel((1 - np.asarray(gamma, np.float64)) * x))


def _exprel(x: Floats) -> Floats:
    """(e^x - 1) / x, 1 at 0."""
    safe = np.where(x == 0, 1, x)
    return np.where(x == 0, 1, np.expm1(safe) / safe)


def anisotropic_beckmann(h: Components, m_x: Floats, m_y: Floats) -> Floats:
    """Beckmann with RMS slope m_x along the grain and m_y across it, normalised; h as by `squared_unit`."""
    slope2 = (h.t / np.square(m_x) + h.b / np.square(m_y)) / h.n
    return np.exp(-slope2) * np.square(1 + (h.t + h.b) / h.n) / (np.pi * m_x * m_y)


def anisotropic_ggx(h: Components, alpha_x: Floats, alpha_y: Floats) -> Floats:
    """GGX with slope scale alpha_x along the grain and alpha_y across it, normalised; h as by `squared_unit`.

    1 / (pi alpha_x alpha_y ((h.t / alpha_x)^2 + (h.b / alpha_y)^2 + (h.n)^2)^2)
    """
    stretched = h.t / np.square(alpha_x) + h.b / np.square(alpha_y) + h.n
    return 1 / (np.pi * alpha_x * alpha_y * np.square(stretched))


def squared_unit(s: Components) -> Components:
    """The squared components of h = s / |s|; that along the normal is at least 1e-18.

    A half vector below the horizon is moved up to it, and one of length 0 points along the grain.
    """
    t, b, n = np.square(s.t), np.square(s.b), np.square(np.maximum(s.n, 0))
    size2 = t + b + n
    scale = 1 / np.maximum(size2, np.finfo(size2.dtype).tiny)
    return Components(np.maximum(t * scale, size2 == 0), b * scale, np.maximum(n * scale, 1e-18))


def power_of_half_height(beta: Floats) -> Floats:
    """c1 = -ln 2 / ln cos(beta): cos^c1 is one half at beta. One text prints it without the minus."""
    return -2 * np.log(2) / np.log1p(-np.square(np.sin(beta)))


def m_of_half_height(beta: Floats) -> Floats:
    """m = beta / sqrt(ln 2): exp(-(theta / m)^2) is one half at beta. One text prints beta / sqrt(2)."""
    return beta / np.sqrt(np.log(2))


def alpha_of_half_height(beta: Floats) -> Floats:
    """c3 = sin(beta) / sqrt(sqrt(2) - cos^2(beta)): pi alpha^2 GGX is one half at beta."""
    return np.sin(beta) / np.sqrt(np.sqrt(2) - np.square(np.cos(beta)))


def vgroove(n_l: Floats, n_v: Floats, s_s: Floats) -> Floats:
    """Torrance and Sparrow's fraction of a V-groove that is lit and visible, 0..1.

    min(1, 2 n_h n_v / v_h, 2 n_h n_l / v_h) with n_h = (n_l + n_v) / |s|, v_h = |s| / 2. Texts print it
    without the 1, or as the fraction that is blocked.
    """
    tiny = np.finfo(np.result_type(s_s)).tiny
    return np.minimum(1, 4 * np.minimum(n_l, n_v) * (n_l + n_v) / np.maximum(s_s, tiny))


def vgroove_over_4ab(n_l: Floats, n_v: Floats, s_s: Floats) -> Floats:
    """G / (4 n_l n_v), finite where n_l or n_v goes to 0: 1 / max(4 a b, max(a, b) |s|^2 / (a + b))."""
    larger = np.maximum(n_l, n_v)
    blocked = larger * s_s / (n_l + n_v)
    return 1 / np.maximum(4 * n_l * n_v, np.maximum(blocked, np.finfo(blocked.dtype).tiny))
