"""Smith's masking: the areas that a direction sees against their integrals, and limits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from illumcli.models import _distributions as distributions
from illumcli.models import _masking as masking
from illumcli.models import _microfacet as facets
from illumcli.models._terms import Angle, Components

AREAS = {"beckmann": masking.beckmann_area, "ggx": masking.ggx_area}
DENSITIES = {"beckmann": facets.anisotropic_beckmann, "ggx": facets.anisotropic_ggx}


def facet_area(area, x, alpha_x, alpha_y):
    """Of one direction, x = (t, b, n)."""
    t, b, n = (np.array([each]) for each in x)
    return area(n, masking.anisotropic_spread2(t, b, np.array(alpha_x), np.array(alpha_y)))


def hemisphere(alpha_x, alpha_y):
    """(t, b, n) of half vectors that follow the slopes of a distribution, and their solid angles."""
    node, weight = leggauss(150)
    u, phi = (1 + node) / 2, (np.arange(180) + 0.5) * np.pi / 90
    radius = u / (1 - u)
    x, y = (np.outer(radius, turn) for turn in (alpha_x * np.cos(phi), alpha_y * np.sin(phi)))
    n = 1 / np.sqrt(1 + x**2 + y**2)
    area = (weight / 2 * radius / (1 - u) ** 2)[:, None] * (np.pi / 90) * alpha_x * alpha_y
    return Components(*(each.ravel() for each in (x * n, y * n, n))), (area * n**3).ravel()


@pytest.mark.parametrize("name", AREAS)
@pytest.mark.parametrize("alphas", [(0.3, 0.3), (0.1, 0.6), (1.5, 0.4)])
def test_facets_project_to_the_area_of_the_surface(name, alphas):
    h, solid_angle = hemisphere(*alphas)
    density = DENSITIES[name](facets.squared_unit(h), *map(np.array, alphas))
    assert np.sum(density * h.n * solid_angle) == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize("name", AREAS)
@pytest.mark.parametrize("alphas", [(0.3, 0.3), (0.1, 0.6), (1.5, 0.4)])
@pytest.mark.parametrize("x", [(0, 0, 1), (0.6, 0, 0.8), (0, 0.96, 0.28), (0.48, 0.8640, 0.1526)])
def test_the_area_seen_is_the_integral_over_the_facets_that_face_the_direction(name, alphas, x):
    x = np.array(x) / np.linalg.norm(x)
    h, solid_angle = hemisphere(*alphas)
    density = DENSITIES[name](facets.squared_unit(h), *map(np.array, alphas))
    faced = np.maximum(x[0] * h.t + x[1] * h.b + x[2] * h.n, 0)
    seen = np.sum(density * faced * solid_angle)
    assert facet_area(AREAS[name], x, *alphas).seen[0] == pytest.approx(seen, rel=1e-4)


def test_ierfc_agrees_with_its_definition_in_50_digits():
    a = np.concatenate([np.linspace(0, 6, 601), np.logspace(-8, 0, 50)])
    with mp.workdps(50):
        exact = [
            mp.exp(-(mp.mpf(x) ** 2)) / mp.sqrt(mp.pi) - mp.mpf(x) * mp.erfc(mp.mpf(x)) for x in a.tolist()
        ]
        double = [abs(mp.mpf(y) / e - 1) for y, e in zip(masking.ierfc(a).tolist(), exact, strict=True)]
    assert max(double) < 5e-15
    single = a.astype(np.float32)
    assert masking.ierfc(single).dtype == np.float32
    np.testing.assert_allclose(masking.ierfc(single), masking.ierfc(single.astype(np.float64)), rtol=3e-6)


def test_beckmanns_lambda_is_smiths_integral():
    for alpha, theta in ((0.3, 1.2), (0.05, 1.55), (1.0, 0.8), (2.0, 1.57)):
        with mp.workdps(30):
            a = 1 / (mp.mpf(alpha) * mp.tan(theta))
            exact = (mp.erf(a) - 1) / 2 + mp.exp(-(a**2)) / (2 * a * mp.sqrt(mp.pi))
        cosine = np.array([np.cos(theta)])
        area = masking.beckmann_area(cosine, masking.isotropic_spread2(cosine, np.array(alpha)))
        assert masking.smith_lambda(area)[0] == pytest.approx(float(exact), rel=1e-11)


@pytest.mark.parametrize("area", AREAS.values(), ids=AREAS)
def test_divided_by_the_cosines_masking_is_the_same_and_finite(area):
    def at(cosine):
        cosine = np.array([cosine])
        return area(cosine, masking.isotropic_spread2(cosine, np.array(0.4)))

    l, v = at(0.3), at(0.7)
    np.testing.assert_allclose(masking.smith_g1(l), 1 / (1 + masking.smith_lambda(l)), rtol=1e-15)
    for over, g2 in (
        (masking.separable_over_4ab, masking.separable_g2),
        (masking.correlated_over_4ab, masking.correlated_g2),
    ):
        np.testing.assert_allclose(over(l, v) * 4 * 0.3 * 0.7, g2(l, v), rtol=1e-14)
        np.testing.assert_allclose(over(l, v), over(v, l), rtol=1e-14)
        assert np.isfinite(over(at(1e-30), v)[0])
    assert np.isfinite(masking.separable_over_4ab(at(0.0), at(0.0))[0])


@pytest.mark.parametrize("area", AREAS.values(), ids=AREAS)
def test_correlated_masking_lies_between_the_separable_and_the_smaller_g1(area):
    cosines = np.linspace(0.01, 0.99, 50)
    l = area(cosines, masking.isotropic_spread2(cosines, np.array(0.5)))
    v = area(cosines[::-1], masking.isotropic_spread2(cosines[::-1], np.array(0.5)))
    correlated = masking.correlated_g2(l, v)
    assert np.all(correlated >= masking.separable_g2(l, v))
    assert np.all(correlated <= np.minimum(masking.smith_g1(l), masking.smith_g1(v)))


@pytest.mark.parametrize("name", AREAS)
def test_equal_roughness_along_and_across_is_the_isotropic_distribution(name):
    s = Components(np.array([0.1, -0.4]), np.array([0.3, 0.2]), np.array([1.5, 0.1]))
    size2 = s.t**2 + s.b**2 + s.n**2
    plain = {"beckmann": facets.beckmann, "ggx": facets.ggx}[name]
    expected = plain(s.n / np.sqrt(size2), (s.t**2 + s.b**2) / size2, np.array(0.4))
    alpha = np.array(0.4)
    np.testing.assert_allclose(DENSITIES[name](facets.squared_unit(s), alpha, alpha), expected, rtol=1e-13)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", AREAS)
@pytest.mark.parametrize("s", [(0, 0, 0), (0, 0, -1e-3), (1e-20, 0, 1e-20), (1, 0, -0.5), (0, 0, 2)])
@pytest.mark.parametrize("alpha", [1e-4, 0.3, 10])
def test_densities_are_finite_for_any_half_vector(name, dtype, s, alpha):
    h = facets.squared_unit(Components(*(np.array([each], dtype) for each in s)))
    density = DENSITIES[name](h, dtype(alpha), dtype(0.3))
    assert density.dtype == dtype
    assert np.isfinite(density[0])


INTEGRATED = {
    "gaussian": lambda w: distributions.Gaussian(m=w),
    "torrance_sparrow": lambda w: distributions.TorranceSparrow(beta=w),
    "blinn": lambda w: distributions.Blinn(beta=w),
    "power": lambda w: distributions.PowerCosine(exponent=2 / w**2),
    "gtr 1": lambda w: distributions.GTR(alpha=w, gamma=1.0),
    "gtr 1.5": lambda w: distributions.GTR(alpha=w, gamma=1.5),
    "gtr 2": lambda w: distributions.GTR(alpha=w, gamma=2.0),
    "gtr 4": lambda w: distributions.GTR(alpha=w, gamma=4.0),
}
widths = pytest.mark.parametrize("width", [1e-4, 0.01, 0.3, 1.0])
every_integrated = pytest.mark.parametrize("D", INTEGRATED.values(), ids=INTEGRATED)


def hidden_by_definition(D, cosine):
    """The projected area of facets that face away, integrated over their angle to the normal.

    Panels shrink towards both ends: facets in profile, and the horizon.
    """
    first, span, panels, total = np.arcsin(cosine), 36.0, 12, 0.0
    half = (np.pi / 2 - first) / 2
    node, weight = leggauss(60)
    for panel in range(panels):
        gap = half * np.exp(-span * (panel + (1 + node) / 2) / panels)
        for beyond, height in ((gap, np.cos(first + gap)), (2 * half - gap, np.sin(gap))):
            sine = np.sin(first + beyond)
            rise = np.sqrt(np.sin(beyond) * np.sin(2 * first + beyond))
            away = 2 * (rise - cosine * height * np.arctan2(rise, cosine * height))
            density = D.density(Angle(height, sine**2))
            total += np.sum(density * sine * away * gap * weight) * span / panels / 2
    return total


@every_integrated
@widths
@pytest.mark.parametrize("cosine", [1e-6, 0.002, 0.1, 0.5, 0.95])
def test_integrated_areas_agree_with_their_definition(D, width, cosine):
    area = D(width).area(np.array([cosine]))
    exact = hidden_by_definition(D(width), cosine)
    assert area.hidden[0] == pytest.approx(exact, abs=2e-12 * (cosine + exact))
    single = D(width).area(np.array([cosine], np.float32))
    assert single.hidden.dtype == np.float32
    assert single.hidden[0] == pytest.approx(exact, abs=1e-5 * (cosine + exact))


def test_integrated_areas_agree_with_ggx_in_closed_form():
    cosine = np.concatenate([np.logspace(-8, 0, 60), np.linspace(0.01, 1, 60)])
    for alpha in (1e-4, 1e-2, 0.3, 1.0):
        closed = distributions.GGX(alpha=alpha).area(cosine)
        integrated = distributions.GTR(alpha=alpha, gamma=2.0).area(cosine)
        np.testing.assert_array_less(np.abs(integrated.hidden - closed.hidden), 1e-12 * closed.seen)


@every_integrated
def test_areas_of_roughness_that_varies_are_those_of_each(D):
    cosine = np.array([0.2, 0.2, 0.9], np.float32)
    drawn = D(0.3)
    values = {name: value for name, value in drawn if isinstance(value, float)}
    varied = drawn.model_copy(update={name: np.full(3, value) for name, value in values.items()})
    np.testing.assert_array_equal(varied.area(cosine).hidden, drawn.area(cosine).hidden)
