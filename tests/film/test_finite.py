"""Values that are not finite are refused, with their channels, counts and places."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.errors import IllumError
from illumcli.film.finite import refuse_nonfinite


def test_finite_bands_pass_and_others_tell_all():
    band = np.zeros((3, 4, 2))
    refuse_nonfinite(band, ("R", "Z"), "a.exr")
    band[1, 2, 0], band[2, 0, 1], band[2, 3, 1] = np.nan, np.inf, -np.inf
    with pytest.raises(IllumError) as caught:
        refuse_nonfinite(band, ("R", "Z"), "a.exr", y0=100)
    first, second = str(caught.value).split("\n")
    assert first == "a.exr: channel R: NaN or infinite in 1 pixels, the first at x 2, y 101"
    assert second.startswith(
        "a.exr: channel Z: NaN or infinite in 2 pixels, the first at x 0, y 102; nothing is"
    )
