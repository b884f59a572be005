"""Cook-Torrance: published values, and how its two conventions differ."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import column_major, unit
from illumcli.models.cook_torrance import CookTorrance
from illumcli.shading.terms import evaluate

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


EVERY_D = [
    {"D": "gaussian"},
    {"D": "beckmann"},
    {"D": "blinn"},
    {"D": "power"},
    {"D": "torrance_sparrow"},
    {"D": "trowbridge_reitz"},
    {"D": "ggx"},
    {"D": "gtr"},
    {"D": "beckmann", "m_y": 0.1},
    {"D": "ggx", "alpha_y": 0.7},
]


def mirror(D, masking):
    """A specular surface alone, F = 1."""
    return CookTorrance.model_validate(
        {
            "diffuse_weight": 0.0,
            "specular_weight": 1.0,
            "distribution": D,
            "fresnel": {"F": "constant"},
            "masking": masking,
        }
    )


def directions(count, least=0.0):
    """Light and eye at random above the normal z, and a grain along x."""
    random = np.random.default_rng(3)
    up, along = np.tile([0.0, 0.0, 1.0], (count, 1)), np.tile([1.0, 0.0, 0.0], (count, 1))
    l, v = random.normal(size=(2, count, 3))
    l[:, 2], v[:, 2] = abs(l[:, 2]) + least, abs(v[:, 2]) + least
    return {
        "n": column_major(up),
        "t": column_major(along),
        "l": unit(column_major(l)),
        "v": unit(column_major(v)),
    }


def specular(model, given):
    return evaluate(model.lobes(), given)["specular"][:, 0]


@pytest.mark.parametrize("alpha", [0.05, 0.5])
def test_ggx_with_correlated_smith_is_what_renderers_have(alpha):
    """The visibility term as Lagarde and de Rousiers (2014) and glTF 2.0 write it."""
    given = directions(200)
    l, v, a2 = given["l"], given["v"], alpha**2
    n_l, n_v = l[:, 2], v[:, 2]
    h = unit(l + v)
    D = a2 / (np.pi * ((a2 - 1) * h[:, 2] ** 2 + 1) ** 2)
    V = 0.5 / (n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2))
    model = mirror({"D": "ggx", "alpha": alpha}, "smith_correlated")
    np.testing.assert_allclose(specular(model, given), D * V * n_l, rtol=1e-10)


@pytest.mark.parametrize("masking", ["smith", "smith_correlated"])
@pytest.mark.parametrize("D", EVERY_D, ids=lambda D: "-".join(D).lower() + D["D"])
def test_smiths_masking_keeps_the_brdf_reciprocal_and_conserves_energy(D, masking):
    model, given = mirror(D, masking), directions(200, least=0.01)
    swapped = given | {"l": given["v"], "v": given["l"]}
    there = specular(model, given) / given["l"][:, 2]
    back = specular(model, swapped) / given["v"][:, 2]
    np.testing.assert_allclose(there, back, rtol=1e-9, atol=1e-12 * there.max())

    # the share of light from one direction that is reflected, over a grid of the hemisphere
    node, weight = np.polynomial.legendre.leggauss(60)
    height, turn = (1 + node) / 2, (np.arange(120) + 0.5) * np.pi / 60
    z, phi = (grid.ravel() for grid in np.meshgrid(height, turn, indexing="ij"))
    level = np.sqrt(1 - z * z)
    grid = {
        "l": column_major(np.stack([level * np.cos(phi), level * np.sin(phi), z], 1)),
        "v": column_major(np.tile([0.8, 0.0, 0.6], (len(z), 1))),
        "n": column_major(np.tile([0.0, 0.0, 1.0], (len(z), 1))),
        "t": column_major(np.tile([0.0, 1.0, 0.0], (len(z), 1))),
    }
    albedo = np.sum(specular(model, grid) * np.repeat(weight / 2, 120)) * np.pi / 60
    assert 0.5 < albedo <= 1 + 1e-3


@pytest.mark.parametrize("masking", ["v_groove", "smith", "smith_correlated"])
@pytest.mark.parametrize(("D", "along", "across"), [("beckmann", "m", "m_y"), ("ggx", "alpha", "alpha_y")])
def test_equal_roughness_across_the_grain_is_isotropic(D, along, across, masking):
    given = directions(200)
    plain = specular(mirror({"D": D, along: 0.3}, masking), given)
    equal = specular(mirror({"D": D, along: 0.3, across: 0.3}, masking), given)
    np.testing.assert_allclose(equal, plain, rtol=1e-11)


@pytest.mark.parametrize("masking", ["v_groove", "smith", "smith_correlated"])
@pytest.mark.parametrize(("D", "along", "across"), [("beckmann", "m", "m_y"), ("ggx", "alpha", "alpha_y")])
def test_turning_the_grain_exchanges_the_two_roughnesses(D, along, across, masking):
    given = directions(200)
    turned = given | {"t": column_major(np.tile([0.0, 1.0, 0.0], (200, 1)))}
    one = specular(mirror({"D": D, along: 0.1, across: 0.4}, masking), given)
    other = specular(mirror({"D": D, along: 0.4, across: 0.1}, masking), turned)
    np.testing.assert_allclose(one, other, rtol=1e-12)
    assert not np.allclose(
        one, specular(mirror({"D": D, along: 0.1, across: 0.4}, masking), turned), rtol=0.1
    )


def test_printed_constants_keep_their_factor_with_smith_and_with_grain():
    given = directions(50)
    for D in ({"D": "beckmann"}, {"D": "beckmann", "m_y": 0.1}):
        microfacet = mirror(D, "smith")
        printed = microfacet.model_copy(update={"convention": "printed"})
        np.testing.assert_allclose(specular(printed, given), 4 * specular(microfacet, given), rtol=1e-13)
