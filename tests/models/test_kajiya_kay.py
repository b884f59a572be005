"""Kajiya-Kay: published values and where the highlight lies."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import unit
from illumcli.models.kajiya_kay import KajiyaKay
from illumcli.shading.terms import evaluate


def test_published_values(cases, agree):
    for case in cases("kajiya_kay"):
        i = case["inputs"]
        given = {word: unit(np.array([i[word]], float)) for word in "tlv"}
        model = KajiyaKay(diffuse=(i["kd"],) * 3, specular=(i["ks"],) * 3, exponent=float(i["exponent"]))
        agree(sum(lobe[0, 0] for lobe in evaluate(model.lobes(), given).values()), case)


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 2.5])
def test_the_highlight_is_the_cone_that_mirrors_the_light(azimuth):
    t, l = np.array([[1.0, 0, 0]]), np.array([[0.6, 0, 0.8]])
    v = np.array([[-0.6, 0.8 * np.sin(azimuth), 0.8 * np.cos(azimuth)]])
    lobe = evaluate(KajiyaKay(exponent=1e6).lobes(), {"t": t, "l": l, "v": v})["specular"]
    np.testing.assert_allclose(lobe, 0.3, rtol=1e-9)
