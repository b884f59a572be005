"""How the first image of a variant differs from its reference."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.sweep_colors import colors, written_colors
from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_reference import Reference
from illumcli.film.metrics import difference

MEASURES = ("rmse", "relative_mse", "mae", "psnr", "largest")
"""Those of `illum compare`, without FLIP, which takes far longer."""
FLIP = "flip"


class Measurer:
    """Measures images against their references, and holds the last reference.

    Parameters
    ----------
    references : mapping
        By number of a variant; empty if nothing is compared.
    flips : bool
        True to measure FLIP, too, in images that have colours.
    """

    def __init__(self, references: Mapping[int, Reference], flips: bool) -> None:
        self.references = references
        self.names = ("mean", *(MEASURES if references else ()), *((FLIP,) if references and flips else ()))
        self._held: tuple[Reference, NDArray[np.float32]] | None = None

    def is_ready(self, outcome: Outcome, outcomes: Sequence[Outcome]) -> bool:
        """True unless the reference is the image of another variant, which is not written yet."""
        reference = self.references.get(outcome.number)
        if reference is None or reference.number is None:
            return True
        return outcomes[reference.number - 1].report is not None

    def of(self, outcome: Outcome) -> dict[str, float]:
        """The measures by name; those that no finite value has are left out."""
        pixels, encoded = written_colors(outcome.paths[0])
        measures = {"mean": float(pixels.mean(dtype=np.float64))}
        reference = self.references.get(outcome.number)
        if reference is not None:
            against = self._pixels(reference)
            measured = difference(against, pixels, 1.0 if encoded else None)
            measures |= {name: getattr(measured, name) for name in MEASURES}
            if FLIP in self.names and pixels.shape[2] == 3 and not measured.not_finite:
                from illumcli.images.flip import flip

                measures[FLIP] = flip(against, pixels, encoded)[0]
        return {name: value for name, value in measures.items() if not math.isnan(value)}

    def _pixels(self, reference: Reference) -> NDArray[np.float32]:
        if self._held is None or self._held[0] != reference:
            read = colors if reference.number is None else written_colors
            self._held = reference, read(reference.path)[0]
        return self._held[1]
