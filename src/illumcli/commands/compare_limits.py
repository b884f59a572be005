"""Limits on the differences of two images."""

from __future__ import annotations

from collections.abc import Mapping

from illumcli.commands.compare import Comparison
from illumcli.errors import InputError, ThresholdError
from illumcli.images.comparison import LayerDifference

LIMITS = {
    "max_rmse": "RMSE",
    "max_mae": "MAE",
    "max_relative": "relative MSE",
    "min_psnr": "PSNR",
    "max_flip": "FLIP",
    "max_difference": "largest difference",
}
"""Limit -> the measure that it limits."""


def refuse_beyond_limits(comparison: Comparison, limits: Mapping[str, float]) -> None:
    """Check that every layer keeps every limit; their names are those of `LIMITS`.

    Raises
    ------
    ThresholdError
        Lists each measure beyond its limit; NaN is beyond any.
    InputError
        FLIP is limited, but no layer has it.
    """
    if "max_flip" in limits and not any(layer.has_colors for layer in comparison.layers):
        raise InputError(
            f"{comparison.test}: no layer compared has R, G and B; limit something else than FLIP"
        )
    beyond = []
    for layer in comparison.layers:
        place, measures = f"{comparison.test}: {layer.name}", measures_of(layer)
        for limit, bound in limits.items():
            value = measures.get(limit)
            is_least = limit == "min_psnr"
            if value is not None and not (value >= bound if is_least else value <= bound):
                side = "below" if is_least else "above"
                beyond.append(f"{place}: {LIMITS[limit]} is {value:.6g}, {side} {bound:g}")
        count = layer.difference.not_finite
        if limits and count:
            beyond.append(f"{place}: {count} values are NaN or infinite in one image")
    if beyond:
        raise ThresholdError("\n".join(beyond))


def measures_of(layer: LayerDifference) -> dict[str, float]:
    """Limit -> the value that it limits."""
    difference = layer.difference
    measures = {
        "max_rmse": difference.rmse,
        "max_mae": difference.mae,
        "max_relative": difference.relative_mse,
        "min_psnr": difference.psnr,
        "max_difference": difference.largest,
    }
    return measures if layer.flip is None else {**measures, "max_flip": layer.flip}
