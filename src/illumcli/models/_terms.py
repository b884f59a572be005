"""Records of terms that belong together: quantities of one vector or angle."""

from __future__ import annotations

from typing import NamedTuple

from illumcli.arrays import Floats


class Angle(NamedTuple):
    """An angle below pi / 2 as cosine and squared sine; each is accurate where the other is not."""

    cosine: Floats  # (N,) above 0
    sin2: Floats  # (N,) squared sine


class Components(NamedTuple):
    """The components of a vector along the tangent (the grain), along the bitangent and along the normal."""

    t: Floats  # (N,)
    b: Floats  # (N,)
    n: Floats  # (N,)
