"""Standard errors of the pixels of a reconstructed picture, by a law that is fitted to its audit.

Which pixels err is seen by the contrast around them: where w bends, along edges, in highlights. The law says
the mean square error by the contrast alone. It is a curve through means over the audited pixels of classes of
contrast, so it needs no form that the error follows: it may fall again where the contrast is highest, as
along silhouettes in pictures of one sample per pixel, which lie at the pixels' centres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats

CLASSES = 16
"""Classes of contrast, with about as many draws each: with 8 the curve is too coarse, with 32 too noisy."""


def standard_errors(contrast: Floats, pixel: NDArray[np.int64], products: Floats, weights: Floats) -> Floats:
    """(N,) float32 standard errors of all pixels of a picture.

    Their mean square is the one that the audit states: the weighted sum of the products, or its own standard
    error where that is larger.

    Parameters
    ----------
    contrast : (N,)
        Range of values around each pixel.
    pixel : (K,) int64
        The pixels that were drawn.
    products : (K,)
        (F - C)(F - D) of each draw: unbiased estimates of the square error.
    weights : (K,)
        Of the draws; their expected sum is 1.
    """
    # Classes of the draws by contrast. Equal contrasts are in one class.
    x = contrast[pixel].astype(np.float64)
    bounds = np.unique(np.sort(x)[[len(x) * k // CLASSES for k in range(1, CLASSES)]])
    number = np.searchsorted(bounds, x)
    total = np.bincount(number, weights)
    filled = total > 0

    # The mean square error of each class; if noise exceeds it, the noise bounds it.
    share = weights / total[number]
    centres = np.bincount(number, share * x)
    means = np.bincount(number, share * products)
    noise = np.sqrt(np.bincount(number, np.square(share * (products - means[number]))))
    curve = np.maximum(means, noise)
    law = np.interp(contrast, centres[filled], curve[filled])

    # Scale it to the error of the whole picture.
    terms = products * weights * len(products)
    stated = max(float(terms.mean()), float(terms.std()) / np.sqrt(max(len(terms) - 1, 1)))
    mean = float(law.mean())
    return np.sqrt(law * (stated / mean) if mean else np.full(len(law), stated)).astype(F)
