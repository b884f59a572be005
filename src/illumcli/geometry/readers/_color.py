"""Vertex colours as files hold them, made linear."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def linear(srgb: ArrayLike) -> NDArray[np.float32]:
    """Linear light of sRGB-coded values in 0..1, by the two-part curve of IEC 61966-2-1 (1999)."""
    code = np.asarray(srgb, np.float64)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)
