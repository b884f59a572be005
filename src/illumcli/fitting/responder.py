"""The response of models at the pairs of a measurement, with terms that are computed once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, column_major
from illumcli.graph import required
from illumcli.models._base import IlluminationModel
from illumcli.shading.terms import ordered_terms


class Responder:
    """Evaluates models of one kind at fixed pairs of directions."""

    def __init__(self, l: Vectors, v: Vectors) -> None:
        shape = l.shape
        self.l, self.v = l, v
        self._buffers: dict[str, Any] = {
            "n": column_major(np.broadcast_to([0.0, 0.0, 1.0], shape)),
            "t": column_major(np.broadcast_to([1.0, 0.0, 0.0], shape)),
            "l": column_major(l, np.float64),
            "v": column_major(v, np.float64),
            "light": np.ones(3),
        }

    def response(self, model: IlluminationModel) -> NDArray[np.float64]:
        """(N, 3) the sum of the lobes, cosine included."""
        lobes = model.lobes()
        out = np.zeros(self.l.shape)
        if not lobes:
            return out
        needs = tuple(dict.fromkeys(need for lobe in lobes.values() for need in required(lobe)))
        for node in ordered_terms(needs):
            if node.output not in self._buffers:
                self._buffers[node.output] = node.run(self._buffers)
        for lobe in lobes.values():
            out += lobe(**{need: self._buffers[need] for need in required(lobe)})
        return out
