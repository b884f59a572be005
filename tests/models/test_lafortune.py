"""Lafortune: the formula as printed, Phong and the retro-reflector as its cases."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models.lafortune import Lafortune
from illumcli.models.phong import Phong

SLANTED = {"n": [0, 0, 1], "t": [1, 0, 0], "l": [1, 0.3, 1], "v": [-0.8, -0.1, 1]}


def test_the_formula_as_printed(respond, frame):
    words = frame(SLANTED)
    l, v = words["l"][0], words["v"][0]
    base = -0.95 * l[0] * v[0] - 0.85 * l[1] * v[1] + 0.9 * l[2] * v[2]
    np.testing.assert_allclose(
        respond(Lafortune(), SLANTED), l[2] * (0.6 / np.pi + 0.5 * base**20), rtol=1e-13
    )


def test_plain_weights_are_phong(respond, frame):
    one = respond(
        Lafortune(diffuse=(0,) * 3, specular=(1,) * 3, cx=-1.0, cy=-1.0, cz=1.0, exponent=1e6), SLANTED
    )
    other = respond(Phong(diffuse=(0,) * 3, specular=(1,) * 3, exponent=1e6), SLANTED)
    np.testing.assert_allclose(one, other * frame(SLANTED)["l"][0, 2], rtol=1e-9)


def test_it_can_send_light_back(respond):
    model = Lafortune(diffuse=(0,) * 3, cx=1.0, cy=1.0, cz=1.0, exponent=1e6)
    back = SLANTED | {"v": SLANTED["l"]}
    assert respond(model, back).min() > 0.3
    assert not respond(model, SLANTED).any()


TWO = Lafortune.model_validate(
    {"specular": [0.2, 0.3, 0.4], "exponent": 50.0, "further": [{"specular": 0.1, "cx": 0.9, "cy": 0.9}]}
)


def test_further_lobes_are_added(respond):
    alone = Lafortune(diffuse=(0,) * 3, specular=(0.1,) * 3, cx=0.9, cy=0.9)
    first = TWO.model_copy(update={"further": ()})
    np.testing.assert_allclose(
        respond(TWO, SLANTED), respond(first, SLANTED) + respond(alone, SLANTED), rtol=1e-14
    )


def test_a_black_first_lobe_leaves_the_further_ones():
    dark = TWO.model_copy(update={"specular": (0.0,) * 3})
    assert "specular" in dark.lobes()
    assert "specular" not in dark.model_copy(update={"further": ()}).lobes()


@pytest.mark.parametrize(("cx", "grain"), [(-0.85, False), (-0.8, True)])
def test_the_grain_of_a_further_lobe_counts(cx, grain):
    model = Lafortune.model_validate({"cx": -0.85, "further": [{"cx": -0.85}, {"cx": cx}]})
    assert model.has_grain() is grain


def test_parameters_of_further_lobes_vary_by_their_number():
    model = Lafortune.model_validate({"further": [{}, {"exponent": {"vertex": "e"}}]})
    assert list(model.varying()) == ["further.1.exponent"]
    exponent = np.array([3.0, 5.0])
    first, second = model.at({"further.1.exponent": exponent}).further
    assert first.exponent == 20
    assert second.exponent is exponent
