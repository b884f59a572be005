"""Terms that belong together: quantities of one vector or angle that a formula takes as one."""

from __future__ import annotations

from typing import NamedTuple

from illumcli.arrays import Floats


class Angle(NamedTuple):
    """An angle below pi / 2 by two functions of it, each exact where the other has lost its digits."""

    cosine: Floats  # (N,) above 0
    sin2: Floats  # (N,) squared sine


class Components(NamedTuple):
    """A vector along the tangent (the grain), across it, and along the normal."""

    t: Floats  # (N,)
    b: Floats  # (N,)
    n: Floats  # (N,)
