"""The FLIP metric: differences that an observer sees when two images alternate."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.color import from_srgb
from illumcli.images.openimageio import oiio


def flip(
    reference: NDArray[np.float32], test: NDArray[np.float32], encoded: bool = False
) -> tuple[float, NDArray[np.float32]]:
    """Mean FLIP error and its (H, W) map: 0 where an observer sees no difference, up to 1.

    Andersson et al. (2020), FLIP: A difference evaluator for alternating images; for linear light the
    largest over exposures as in Andersson et al. (2021), Visualizing errors in rendered high dynamic range
    images. The exposures are those of a median of 0.18 and a maximum of 2, whatever the image, so that
    figures of different images compare. The observer sits 0.7 m from a 0.7 m wide screen of 3840 pixels.

    Parameters
    ----------
    reference, test : (H, W, 3) float32, finite
        Linear light, or display values (sRGB, 0..1) when `encoded`.
    """
    a, b = (_linear_buffer(from_srgb(np.clip(each, 0, 1)) if encoded else each) for each in (reference, test))
    error_image = oiio.ImageBufAlgo.FLIP_diff(a, b, hdr=0 if encoded else 1)
    if error_image.has_error:
        raise RuntimeError(error_image.geterror())
    errors = np.asarray(error_image.get_pixels(oiio.FLOAT))[..., 0]
    return float(errors.mean(dtype=np.float64)), errors


def _linear_buffer(pixels: NDArray[Any]) -> oiio.ImageBuf:
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT)
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels, np.float32))
    return buffer
