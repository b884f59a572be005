"""Terms of models: only needed ones are formed, and they keep digits that plain formulas lose."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from illumcli.graph import topological_order
from illumcli.models.cook_torrance import CookTorrance
from illumcli.models.lambert import Lambert
from illumcli.models.ward import Ward
from illumcli.shading.terms import GIVEN, TERMS, evaluate, given_terms, ordered_terms


def term(name, **given):
    buffers = dict(given)
    for node in ordered_terms((name,), tuple(given)):
        buffers[node.output] = node.run(buffers)
    return buffers[name]


def test_every_term_stands_on_given_words():
    assert len(topological_order(TERMS, TERMS, GIVEN)) == len(TERMS)


def test_models_reach_only_the_words_they_need():
    assert given_terms(Lambert().lobes()) == {"n", "l"}
    assert given_terms(CookTorrance().lobes()) == {"n", "l", "v"}
    assert given_terms(Ward().lobes()) == {"n", "l", "v", "t"}


def test_terms_that_lobes_share_are_formed_once():
    formed = [step.output for step in ordered_terms(("n_l", "n_v", "s_s", "v_h", "n_h", "sin2_h"))]
    assert len(formed) == len(set(formed))


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9])
def test_gaps_and_sines_keep_their_digits_near_the_normal(angle):
    n, l = np.array([[0.0, 0, 1]]), np.array([[0.0, 0, 1]])
    v = np.array([[np.sin(2 * angle), 0, np.cos(2 * angle)]])
    assert term("gap_nh", n=n, l=l, v=v) == pytest.approx(2 * np.sin(angle / 2) ** 2, rel=1e-6, abs=1e-32)
    assert term("sin2_h", n=n, l=l, v=v) == pytest.approx(np.sin(angle) ** 2, rel=1e-6)


def test_without_a_half_vector_there_is_no_highlight():
    n, l = np.array([[0.0, 0, 1]]), np.array([[0.6, 0, 0.8]])
    assert term("gap_nh", n=n, l=l, v=-l) >= 1
    assert term("sin2_h", n=n, l=l, v=-l) == 1


def test_azimuth_of_a_vector_on_the_normal_is_none():
    n = np.array([[0.0, 0, 1]])
    assert term("cos_phi", n=n, l=n, v=np.array([[0.6, 0, 0.8]])) == 0


def test_evaluating_a_model_does_not_keep_it_alive():
    model = Lambert().at({"diffuse": np.ones((2, 3))})
    evaluate(model.lobes(), {"n": np.ones((2, 3)), "l": np.ones((2, 3))})
    watched = weakref.ref(model)
    del model
    gc.collect()
    assert watched() is None
