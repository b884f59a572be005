"""Cook-Torrance: published values, and how its two conventions differ."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.cook_torrance import CookTorrance

DISTRIBUTIONS = {
    "beckmann": lambda p: {"D": "beckmann", "m": p["m"]},
    "beckmann_ct1982": lambda p: {"D": "beckmann", "m": p["m"]},
    "ggx": lambda p: {"D": "ggx", "alpha": p["alpha"]},
    "blinn_normalised": lambda p: {"D": "power", "exponent": float(p["exponent"])},
}
FRESNEL = {
    "dielectric": lambda p: {"F": "dielectric", "ior": p["eta"]},
    "conductor": lambda p: {"F": "conductor", "n": p["eta"], "k": p["k"]},
    "schlick": lambda p: {"F": "schlick", "f0": p["f0"]},
    "one": lambda p: {"F": "constant"},
}


def model_of(i):
    return CookTorrance.model_validate(
        {
            "diffuse": i["albedo"],
            "diffuse_weight": i["kd"],
            "specular_weight": i["ks"],
            "distribution": DISTRIBUTIONS[i["D"]["kind"]](i["D"]),
            "fresnel": FRESNEL[i["F"]["kind"]](i["F"]),
            "convention": "printed" if i["convention"] == "printed_pi" else "microfacet",
        }
    )


def test_published_values(cases, brdf, agree):
    for case in cases("cook_torrance"):
        agree(brdf(model_of(case["inputs"]), case["inputs"]), case)


def test_printed_constants_are_four_times_as_bright(respond):
    inputs = {"n": [0, 0, 1], "l": [1, 0, 2], "v": [-1, 0.2, 2]}
    printed, microfacet = (
        respond(CookTorrance(diffuse=(0, 0, 0), convention=each), inputs)
        for each in ("printed", "microfacet")
    )
    np.testing.assert_allclose(printed, 4 * microfacet, rtol=1e-14)


def test_weights_share_one_unless_both_are_given(respond):
    inputs = {"n": [0, 0, 1], "l": [1, 0, 2], "v": [0, 1, 1]}
    dull = respond(CookTorrance(specular_weight=0.25, fresnel={"F": "constant", "value": 0}), inputs)
    given = respond(CookTorrance(specular_weight=0.0, diffuse_weight=0.75), inputs)
    np.testing.assert_allclose(dull, given, rtol=1e-15)


def test_only_a_literal_color_shift_asks_for_the_light():
    from illumcli.shading.terms import given_terms

    assert "light" not in given_terms(CookTorrance(fresnel={"F": "shifted"}).lobes())
    assert "light" in given_terms(CookTorrance(fresnel={"F": "shifted", "grazing": "light"}).lobes())


def test_roughness_may_vary_over_the_surface(respond):
    model = CookTorrance(diffuse=(0, 0, 0), distribution={"D": "ggx", "alpha": {"vertex": "wear"}})
    assert set(model.varying()) == {"distribution.alpha"}
    inputs = {"n": [0, 0, 1], "l": [1, 0, 2], "v": [-1, 0.2, 2]}
    varied = respond(model.at({"distribution.alpha": np.array([0.2])}), inputs)
    plain = respond(CookTorrance(diffuse=(0, 0, 0), distribution={"D": "ggx", "alpha": 0.2}), inputs)
    np.testing.assert_array_equal(varied, plain)


@pytest.mark.parametrize("m", [0.3, 0.6])
def test_a_mirror_surface_reflects_the_published_share(m):
    """Directional albedo at normal incidence with F = 1, four digits: 0.9956 and 0.7976."""
    from illumcli.arrays import column_major
    from illumcli.shading.terms import evaluate

    node, weight = np.polynomial.legendre.leggauss(200)
    theta = (1 + node) * np.pi / 4
    l = column_major(np.stack([np.sin(theta), 0 * theta, np.cos(theta)], 1))
    up = column_major(np.tile([0.0, 0.0, 1.0], (len(l), 1)))
    model = CookTorrance(
        diffuse_weight=0.0,
        specular_weight=1.0,
        distribution={"D": "beckmann", "m": m},
        fresnel={"F": "constant"},
    )
    response = evaluate(model.lobes(), {"n": up, "l": l, "v": up})["specular"][:, 0]
    albedo = np.sum(response * np.sin(theta) * weight) * np.pi / 4 * 2 * np.pi
    assert albedo == pytest.approx({0.3: 0.9956, 0.6: 0.7976}[m], abs=1e-4)
