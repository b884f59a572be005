"""Poulin-Fournier: published values, the flat limit, quadrature against the closed form."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.phong import Phong
from illumcli.models.poulin_fournier import PoulinFournier

SLANTED = {"n": [0, 0, 1], "t": [1, 0, 0], "l": [1, 0.3, 1], "v": [-0.8, -0.1, 1]}


def model_of(i, **other):
    given = {"diffuse": (i["kd"],) * 3, "specular": (i["ks"],) * 3, "slope": i["theta_s"]}
    return PoulinFournier(**given | {"exponent": float(i["exponent"])} | other)


def test_published_values(cases, brdf, agree):
    for case in cases("aniso_cylinder"):
        agree(brdf(model_of(case["inputs"]), case["inputs"])[0], case)


def test_quadrature_of_a_constant_highlight_is_the_closed_form(cases, respond):
    """<n.h>^0 is 1, so ks / pi takes the place of kd / pi."""
    for case in cases("aniso_cylinder"):
        closed = model_of(case["inputs"], diffuse=(1, 1, 1), specular=(0, 0, 0))
        summed = model_of(case["inputs"], diffuse=(0, 0, 0), specular=(1, 1, 1), exponent=0.0)
        np.testing.assert_allclose(
            respond(summed, case["inputs"]), respond(closed, case["inputs"]), rtol=1e-11, atol=1e-15
        )


@pytest.mark.parametrize("exponent", [0.5, 3.0, 100.0, 1e4, 1e6])
def test_single_precision_holds_the_quadrature(exponent):
    from illumcli.arrays import F, column_major, cross, unit
    from illumcli.shading.terms import evaluate

    random = np.random.default_rng(3)
    n = unit(column_major(random.normal(size=(4000, 3))))
    t = unit(cross(n, unit(column_major(random.normal(size=(4000, 3))))))
    l = unit(unit(column_major(random.normal(size=(4000, 3)))) + 1.1 * n)
    v = unit(
        2 * np.sum(n * l, 1)[:, None] * n - l + 0.1 * column_major(random.normal(size=(4000, 3))) + 0.1 * n
    )
    seen = np.sum(n * v, 1) > 0.05
    given = {
        name: column_major(value[seen].astype(F)) for name, value in {"n": n, "t": t, "l": l, "v": v}.items()
    }
    lobes = PoulinFournier(diffuse=(0, 0, 0), exponent=exponent).lobes()
    single = evaluate(lobes, given)["specular"]
    double = evaluate(lobes, {name: value.astype(float) for name, value in given.items()})["specular"]
    worst = np.abs(single - double) / (double + 1e-3 * double.max())
    assert worst.max() < 2e-5 + 2e-8 * np.sqrt(exponent) * 10


def test_without_slope_it_is_the_facet(respond):
    flat = respond(PoulinFournier(slope=1e-3, specular=(0, 0, 0)), SLANTED)
    np.testing.assert_allclose(
        flat, respond(Phong(diffuse=(0.6,) * 3, specular=(0,) * 3, normalised=True), SLANTED), rtol=1e-6
    )


@pytest.mark.parametrize("exponent", [1e3, 1e6, 1e9])
def test_sharp_highlights_match_a_fine_sum(respond, frame, exponent):
    """A mirror-like groove: trapezoids over the lobe, 20,000 of them, converge to all digits."""
    words = {name: value[0] for name, value in frame(SLANTED | {"t": [0, 1, 0]}).items()}
    n, t, l, v = (words[name] for name in "ntlv")
    b, h = np.cross(n, t), l + v
    h /= np.linalg.norm(h)
    top = np.arctan2(h @ b, h @ n)
    psi = top + np.linspace(-1, 1, 20001) * 12 / np.sqrt(exponent)
    facet = np.cos(psi)[:, None] * n + np.sin(psi)[:, None] * b
    inside = np.abs(psi) < 0.5
    gap = ((facet - h) ** 2).sum(1) / 2
    values = np.exp(exponent * np.log1p(-gap)) * (facet @ l) * (facet @ v) * inside
    expected = values.sum() * (psi[1] - psi[0]) * (exponent + 2) / (2 * np.pi) / (2 * np.sin(0.5) * (n @ v))
    found = respond(
        PoulinFournier(diffuse=(0,) * 3, specular=(1,) * 3, exponent=exponent), SLANTED | {"t": [0, 1, 0]}
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-280)
