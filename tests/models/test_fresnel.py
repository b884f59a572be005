"""Reflectance at a facet against published values and its limits."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models import _fresnel as fresnel


def test_dielectrics_have_the_published_values(cases, agree):
    for case in cases("fresnel_dielectric"):
        agree(fresnel.dielectric(case["inputs"]["cos"], case["inputs"]["eta"]), case)


def test_sine_and_tangent_form_is_the_same_law(cases, agree):
    for case in cases("fresnel_sin_tan"):
        agree(fresnel.dielectric(np.cos(case["inputs"]["phi"]), case["inputs"]["mu"]), case)


def test_conductors_have_the_published_values(cases, agree):
    for case in cases("fresnel_conductor"):
        agree(fresnel.conductor(case["inputs"]["cos"], case["inputs"]["eta"], case["inputs"]["k"]), case)


def test_schlick_has_the_published_values(cases, agree):
    for case in cases("fresnel_schlick"):
        agree(fresnel.schlick(case["inputs"]["cos"], case["inputs"]["f0"]), case)


def test_index_and_normal_reflectance_have_the_published_values(cases, agree):
    for case in cases("eta_from_f0"):
        agree(fresnel.eta_from_f0(case["inputs"]["f0"]), case)
    for case in cases("f0_from_eta"):
        agree(fresnel.f0_from_eta(case["inputs"]["eta"], case["inputs"]["k"]), case)


def test_colors_shift_as_published(cases, agree):
    for case in cases("ct_color_shift"):
        i = case["inputs"]
        agree(fresnel.color_shift(i["cos"], i["eta"], np.array(i["color0"]), np.array(i["color90"])), case)


@pytest.mark.parametrize("eta", [0.4, 0.75, 1.5, 9.0, 1000.0])
def test_a_metal_without_absorption_is_a_dielectric(eta):
    c = np.linspace(0, 1, 201)
    np.testing.assert_allclose(fresnel.conductor(c, eta, 0), fresnel.dielectric(c, eta), rtol=1e-12)


def test_total_reflection_ends_at_the_critical_angle():
    critical = np.sqrt(1 - 0.75**2)
    below, above = fresnel.dielectric(critical * np.array([[0.999], [1.001]]), 0.75)
    assert below == 1
    assert above < 1


def test_nothing_reflects_without_a_boundary():
    c = np.linspace(0, 1, 11)
    assert not fresnel.dielectric(c, 1.0).any()
    assert not fresnel.conductor(c, 1.0, 0.0).any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_choice_keeps_range_and_precision(dtype):
    c = np.linspace(0, 1, 1001, dtype=dtype)
    light = np.array([1, 0, 0.5], dtype)
    for Choice in (
        fresnel.Dielectric,
        fresnel.Conductor,
        fresnel.Schlick,
        fresnel.Material,
        fresnel.Shifted,
        fresnel.Constant,
    ):
        F = Choice().reflectance(c, light)
        assert F.dtype == dtype
        assert 0 <= F.min() <= F.max() <= 1


@pytest.mark.parametrize("name", fresnel.MATERIALS)
@pytest.mark.parametrize("curve", ["dielectric", "schlick"])
def test_materials_reflect_their_table_at_the_normal_and_all_at_grazing(name, curve):
    F = fresnel.Material(name=name, curve=curve).reflectance(np.array([1.0, 0.0]))
    np.testing.assert_allclose(F[:, 0], fresnel.MATERIALS[name], rtol=1e-12)
    np.testing.assert_allclose(F[:, 1], 1, rtol=1e-12)


def test_shifted_color_ends_white_unless_the_text_is_taken_literally():
    light = np.array([1.0, 0.5, 0.25])
    grazing = fresnel.Shifted().reflectance(np.array([0.0]))[:, 0]
    literal = fresnel.Shifted(grazing="light").reflectance(np.array([0.0]), light)[:, 0]
    np.testing.assert_allclose(grazing, 1)
    np.testing.assert_allclose(literal, light)
