"""How far a model is from a measurement: three metrics of the BRDF times the cosine of the light.

E^2 = sum_i w_i sum_c (T(m_ic) - T(d_ic))^2 / 3,  m and d the model's and the measured f_r n.l,  sum_i w_i = 1

cosine       T(x) = x             Ngan et al. (2005): follows the highlight's peak
cube_root    T(x) = cbrt(x)       Fores et al. (2012): ranks models as observers do
log          T(x) = ln(1 + x)     Low et al. (2012): between both

All three have the weights by solid angle of Ngan et al., so that they can be compared; Low et al. weigh
by the solid angle of the light alone. Noise may make measured values negative: T is continued as an odd
function.

References
----------
Ngan, A., Durand, F., Matusik, W. (2005). Experimental analysis of BRDF models. EGSR '05.
Fores, A., Ferwerda, J., Gu, J. (2012). Toward a perceptually based metric for BRDF modeling. CIC20.
Low, J., Kronander, J., Ynnerman, A., Unger, J. (2012). BRDF models for accurate and efficient rendering of
glossy surfaces. ACM Trans. Graph. 31(1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]


def _log(x: Doubles) -> Doubles:
    return np.copysign(np.log1p(np.abs(x)), x)


def _log_slope(x: Doubles) -> Doubles:
    return 1 / (1 + np.abs(x))


def _cube_root_slope(x: Doubles) -> Doubles:
    return 1 / (3 * np.square(np.cbrt(np.where(x == 0, np.finfo(np.float64).tiny, x))))


TRANSFORMS: dict[str, Callable[[Doubles], Doubles]] = {
    "cosine": np.asarray,
    "cube_root": np.cbrt,
    "log": _log,
}
"""Metric -> T."""
SLOPES: dict[str, Callable[[Doubles], Doubles]] = {
    "cosine": np.ones_like,
    "cube_root": _cube_root_slope,
    "log": _log_slope,
}
"""Metric -> the derivative of T."""


def distance(metric: str, model: Doubles, data: Doubles, weight: Doubles) -> float:
    """E of a metric.

    Parameters
    ----------
    model, data : ndarray
        (N, 3) f_r n.l.
    weight : ndarray
        (N,) of sum 1.
    """
    transform = TRANSFORMS[metric]
    squares = np.square(transform(model) - transform(data)).mean(axis=1)
    return float(np.sqrt(weight @ squares))
