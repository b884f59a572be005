"""Oren-Nayar: published values, Lambert as its limit, the clamp."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import column_major
from illumcli.models.lambert import Lambert
from illumcli.models.oren_nayar import OrenNayar, oren_nayar_terms
from illumcli.shading.terms import evaluate


def grey(i, form):
    return OrenNayar(diffuse=(i["albedo"],) * 3, sigma=i["sigma"], form=form)


@pytest.mark.parametrize(("name", "form"), [("oren_nayar_full", "full"), ("oren_nayar_ab", "qualitative")])
def test_published_values(cases, brdf, agree, name, form):
    for case in cases(name):
        agree(brdf(grey(case["inputs"], form), case["inputs"])[0], case)


def test_published_terms(cases, frame, term, agree):
    for case in cases("oren_nayar_terms"):
        i = case["inputs"]
        words = frame(i)
        if min((words["n"] * words[word]).sum() for word in "lv") <= 0:
            agree([0, 0], case)
            continue
        named = [term(name, **words) for name in ("n_l", "n_v", "sin_l", "sin_v", "cos_phi")]
        one, two = oren_nayar_terms(*named, i["sigma"])
        agree([one[0] * i["albedo"] / np.pi, two[0] * i["albedo"] ** 2 / np.pi], case)


@pytest.mark.parametrize("form", ["full", "qualitative"])
def test_without_roughness_it_is_lambert(respond, form):
    inputs = {"n": [0, 0, 1], "l": [3, 1, 0.1], "v": [-1, 2, 0.4]}
    np.testing.assert_array_equal(
        respond(OrenNayar(sigma=0.0, form=form), inputs), respond(Lambert(), inputs)
    )


def test_a_dark_rough_surface_is_black_where_the_fit_turns_negative(respond):
    inputs = {"n": [0, 0, 1], "l": [1, 0, 1e-4], "v": [-1, 0, 1e-4]}
    assert not respond(OrenNayar(diffuse=(0.01, 0.01, 0.01), sigma=1.5), inputs).any()


def test_albedo_of_the_qualitative_form_in_closed_form(cases, agree):
    node, weight = np.polynomial.legendre.leggauss(60)
    for case in cases("directional_albedo"):
        i = case["inputs"]
        if i["kind"] != "oren_nayar_ab" or i["theta"] > 1.5:
            continue
        total = 0.0
        for low, high in ((0, i["theta"]), (i["theta"], np.pi / 2)):
            theta = low + (1 + node) * (high - low) / 2
            phi = (1 + node) * np.pi / 4  # the term is 0 beyond a right angle, symmetric about 0
            T, P = (grid.ravel() for grid in np.meshgrid(theta, phi))
            l = column_major(np.stack([np.sin(T) * np.cos(P), np.sin(T) * np.sin(P), np.cos(T)], 1))
            v = column_major(np.tile([np.sin(i["theta"]), 0, np.cos(i["theta"])], (len(T), 1)))
            n = column_major(np.tile([0.0, 0.0, 1.0], (len(T), 1)))
            lobes = grey(i, "qualitative").lobes()
            bright = evaluate(lobes, {"n": n, "l": l, "v": v})["diffuse"][:, 0]
            dark = evaluate(lobes, {"n": n, "l": l * [-1, -1, 1], "v": v})["diffuse"][:, 0]
            both = ((bright + dark) * np.sin(T)).reshape(60, 60)
            total += weight @ both @ weight * (high - low) / 2 * np.pi / 4 * 2
        assert total == pytest.approx(case["expected"], rel=1e-9)
