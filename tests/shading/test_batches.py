"""Materials that are evaluated together."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.models._parameters import Texture
from illumcli.models.cook_torrance import CookTorrance
from illumcli.models.lambert import Lambert
from illumcli.models.phong import Phong
from illumcli.shading.batches import batches
from illumcli.shading.direct import FEW_GROUPS, groups


def test_materials_of_one_formula_share_a_batch_with_tables_of_what_differs():
    made = batches(
        [Phong(exponent=3), Lambert(), Phong(exponent=9, emission=2), Phong(exponent=9, diffuse=0.5)]
    )
    assert made.batch.tolist() == [0, 1, 0, 0]
    assert made.row.tolist() == [0, 0, 1, 2]
    assert sorted(made.every[0].differing) == ["diffuse", "exponent"]
    assert made.every[0].differing["exponent"].tolist() == [3, 9, 9]
    assert not made.every[1].differing


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Phong(), Phong(normalised=True)),
        (Phong(), Phong(specular=0)),
        (Phong(), Phong(diffuse=Texture(texture="a.png"))),
        (Phong(diffuse=Texture(texture="a.png")), Phong(diffuse=Texture(texture="a.png"))),
        (CookTorrance(), CookTorrance(diffuse_weight=0.3)),
        (CookTorrance(), CookTorrance(distribution={"D": "ggx"})),
    ],
)
def test_choices_black_lobes_and_textures_keep_materials_apart(one, other):
    assert batches([one, other]).batch.tolist() == [0, 1]


def test_numbers_within_a_distribution_differ_by_their_path():
    made = batches([CookTorrance(distribution={"D": "beckmann", "m": m}) for m in (0.1, 0.2)])
    assert list(made.every[0].differing) == ["distribution.m"]


@pytest.mark.parametrize("count", [3, FEW_GROUPS + 30])
def test_groups_are_ascending_indices_of_every_number_that_occurs(count):
    number = np.random.default_rng(2).choice(np.arange(0, count, 2), 200).astype(np.int32)
    made = groups(number, count)
    assert [k for k, _ in made] == np.unique(number).tolist()
    for k, index in made:
        np.testing.assert_array_equal(index, np.flatnonzero(number == k))
