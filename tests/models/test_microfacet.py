"""Facet distributions and the V-groove term against published values and their integrals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from illumcli.models import _distributions as distributions
from illumcli.models import _microfacet as facets
from illumcli.models._terms import Angle


def value(kind, n_h, sin2, p):
    """D of a published case, which may have a constant of its own."""
    match kind:
        case "gaussian":
            return distributions.Gaussian(m=p["m"], c=p["c"]).density(Angle(n_h, sin2))
        case "beckmann":
            return distributions.Beckmann(m=p["m"]).density(Angle(n_h, sin2))
        case "beckmann_ct1982":
            return distributions.Beckmann(m=p["m"]).density(Angle(n_h, sin2), printed=True)
        case "beckmann_quarter":
            return distributions.Beckmann(m=p["m"]).density(Angle(n_h, sin2), printed=True) / 4
        case "beckmann_slope1d":
            return facets.beckmann_slope1d(n_h, sin2, p["m"])
        case "blinn":
            return distributions.Blinn(beta=p["beta"]).density(Angle(n_h, sin2), printed=True)
        case "blinn_normalised":
            return distributions.PowerCosine(exponent=float(p["exponent"])).density(Angle(n_h, sin2))
        case "torrance_sparrow":
            return distributions.TorranceSparrow(beta=p["beta"]).density(Angle(n_h, sin2), printed=True)
        case "trowbridge_reitz":
            return distributions.TrowbridgeReitz(beta=p["beta"]).density(Angle(n_h, sin2), printed=True)
        case "ggx":
            return distributions.GGX(alpha=p["alpha"]).density(Angle(n_h, sin2))


def test_distributions_have_the_published_values(cases, frame, term, agree):
    for case in cases("ndf"):
        words, p = frame(case["inputs"]), case["inputs"]["D"]
        n, h = words["n"], words["h"]
        if (n * h).sum() <= 0:
            agree(0, case)
        else:
            agree(value(p["kind"], term("n_h", n=n, s=h), term("sin2_h", n=n, s=h), p), case)


@pytest.mark.parametrize("width", [0.002, 0.05, 0.3, 0.9, 1.5])
@pytest.mark.parametrize(
    "D",
    [
        lambda w: distributions.Gaussian(m=w),
        lambda w: distributions.Beckmann(m=w),
        lambda w: distributions.Blinn(beta=w),
        lambda w: distributions.PowerCosine(exponent=2 / w**2),
        lambda w: distributions.TorranceSparrow(beta=w),
        lambda w: distributions.TrowbridgeReitz(beta=w),
        lambda w: distributions.GGX(alpha=w),
        lambda w: distributions.GTR(alpha=min(w, 1), gamma=1.0),
        lambda w: distributions.GTR(alpha=min(w, 1), gamma=2.0),
    ],
    ids=[
        "gaussian",
        "beckmann",
        "blinn",
        "power",
        "torrance_sparrow",
        "trowbridge_reitz",
        "ggx",
        "gtr_1",
        "gtr_2.5",
    ],
)
def test_a_normalised_distribution_projects_to_one(D, width):
    node, weight = leggauss(200)
    u = (1 + node) / 2  # tan(theta) = width * u / (1 - u) spreads the nodes over the lobe
    tan = width * u / (1 - u)
    cos = 1 / np.hypot(1, tan)
    jacobian = width / (1 - u) ** 2 * cos**2 * weight / 2
    density = D(width).density(Angle(cos, np.square(tan * cos)))
    assert 2 * np.pi * np.sum(density * cos * tan * cos * jacobian) == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize(
    "D", [distributions.Blinn, distributions.TorranceSparrow, distributions.TrowbridgeReitz]
)
def test_half_height_is_where_the_distribution_is_half(D):
    angle = np.array([0, 0.4])
    printed = D(beta=0.4).density(Angle(np.cos(angle), np.sin(angle) ** 2), printed=True)
    np.testing.assert_allclose(printed, [1, 0.5], rtol=1e-14)


def test_beckmann_has_its_rms_slope():
    node, weight = leggauss(100)
    theta = (1 + node) * np.pi / 4
    density = facets.beckmann(np.cos(theta), np.sin(theta) ** 2, 0.3)
    moment = density * np.cos(theta) * np.tan(theta) ** 2 * np.sin(theta) * weight
    assert moment.sum() * np.pi / 4 * 2 * np.pi == pytest.approx(0.09, rel=1e-10)


def test_v_grooves_have_the_published_values(cases, frame, term, agree):
    for case in cases("geometry_vgroove"):
        words = frame(case["inputs"])
        n_l, n_v = ((words["n"] * words[word]).sum(1) for word in "lv")
        s_s = term("s_s", l=words["l"], v=words["v"])
        agree(facets.vgroove(n_l, n_v, s_s) if min(n_l, n_v) > 0 else 0, case)


def test_v_grooves_divided_by_the_cosines_stay_finite_at_the_horizon():
    n_l, n_v = np.array([0.0, 0.5, 1e-9]), np.array([0.5, 1e-12, 1e-9])
    s_s = np.array([2.0, 2.0, 4.0])
    over = facets.vgroove_over_4ab(n_l, n_v, s_s)
    assert np.all(np.isfinite(over))
    np.testing.assert_allclose(
        over[1:] * 4 * n_l[1:] * n_v[1:], facets.vgroove(n_l, n_v, s_s)[1:], rtol=1e-14
    )


@pytest.mark.parametrize("alpha", [0.01, 0.4, 1.0])
def test_gtr_of_exponent_2_is_ggx(alpha):
    theta = Angle(np.array([1, 0.99, 0.3]), np.array([0, 1 - 0.99**2, 1 - 0.09]))
    ggx = distributions.GGX(alpha=alpha).density(theta)
    np.testing.assert_allclose(distributions.GTR(alpha=alpha, gamma=2.0).density(theta), ggx, rtol=1e-12)


def test_gtr_of_exponent_1_is_berrys():
    """(alpha^2 - 1) / (pi ln(alpha^2)) / (1 + (alpha^2 - 1) cos^2), as Burley prints it."""
    alpha, cosine = 0.2, np.array([1, 0.9, 0.1])
    printed = (alpha**2 - 1) / (np.pi * np.log(alpha**2)) / (1 + (alpha**2 - 1) * cosine**2)
    density = distributions.GTR(alpha=alpha, gamma=1.0).density(Angle(cosine, 1 - cosine**2))
    np.testing.assert_allclose(density, printed, rtol=1e-12)
    near = distributions.GTR(alpha=alpha, gamma=1 + 1e-9).density(Angle(cosine, 1 - cosine**2))
    np.testing.assert_allclose(near, printed, rtol=1e-8)
