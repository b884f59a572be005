"""What a fit found, as text and as data."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from illumcli.fitting.fit import Fit
from illumcli.fitting.material import shown
from illumcli.fitting.measurement import Measurement
from illumcli.schema.families import tag_of
from illumcli.tables import aligned

BEYOND_NOISE = 2.0
"""A chi squared per value above which the model does not describe the data within their errors."""


def report(fit: Fit) -> str:
    """Parameters with their standard errors, the three metrics, and what to know of them."""
    rows = [("parameter", "value", "standard error")]
    for label, value, error, state in _values(fit):
        rows.append((label, f"{shown(value, error):g}", state or f"{error:.2g}"))
    metrics = [("metric", "error", "of the measurement")]
    for name, error in fit.distances.items():
        title = f"{name}, minimised" if name == fit.metric else name
        metrics.append((title, f"{error:.4g}", f"{error / max(fit.sizes[name], 1e-300):.2%}"))
    lines = [f"{tag_of(type(fit.model))}:", *aligned(rows), "", *aligned(metrics, {1, 2}), ""]
    return "\n".join([*lines, *notes(fit)])


def notes(fit: Fit) -> list[str]:
    """What must be known to judge the parameters."""
    optimum, labels = fit.optimum, fit.parameters.labels()
    out = [f"{optimum.reached} of {optimum.starts} starts reached this optimum"]
    out += [
        f"{path} is kept equal to {source}: the measurement shows no grain" for path, source in _ties(fit)
    ]
    for label, at, chosen in zip(labels, optimum.at_limit, optimum.chosen, strict=True):
        if chosen:
            out.append(
                f"{label} is held at the end of its range: other parameters make up for any change of it"
            )
        elif at:
            out.append(f"{label} is at the end of its range; the standard errors hold for it staying there")
    for names in fit.uncertainty.undetermined:
        fact = "is not determined" if len(names) == 1 else "are not determined, only a combination of them"
        out.append(f"{', '.join(names)} {fact}: the measurement does not change with it; hold it with -D")
    for names in fit.uncertainty.loose:
        out.append(f"{', '.join(names)}: hardly determined by this measurement; hold one with -D")
    if np.any(np.isnan(fit.uncertainty.standard_error) & ~optimum.is_held):
        out.append(
            "there are as many parameters as data, and no data tell the noise: no standard error is known"
        )
    if fit.chi_squared is not None:
        fact = f"chi squared per value is {fit.chi_squared:.3g}"
        beyond = ": the model does not describe the measurement within its errors, which alone the standard "
        out.append(f"{fact}{beyond}errors count" if fit.chi_squared > BEYOND_NOISE else fact)
    return out


def undetermined(fit: Fit) -> list[str]:
    """Names of the parameters that are not determined, or only in combination with others."""
    return [label for label, _, error, _ in _values(fit) if math.isinf(error)]


def data(fit: Fit, measurement: Measurement, path: Path, name: str) -> dict[str, Any]:
    """A fit for JSON."""
    return {
        "file": str(path),
        "pairs": len(measurement.values),
        "model": tag_of(type(fit.model)),
        "metric": fit.metric,
        "materials": {name: fit.material},
        "parameters": [
            {"name": label, "value": value, "standard_error": error if math.isfinite(error) else None}
            | ({"held": state} if state else {})
            for label, value, error, state in _values(fit)
        ],
        "metrics": fit.distances,
        "of_measurement": {key: fit.distances[key] / max(fit.sizes[key], 1e-300) for key in fit.sizes},
        "chi_squared": fit.chi_squared,
        "starts": fit.optimum.starts,
        "reached": fit.optimum.reached,
        "notes": notes(fit),
    }


def ranking(fits: list[Fit]) -> str:
    """The metrics of several models, the best of each metric marked."""
    names = list(fits[0].distances)
    best = {name: min(fit.distances[name] for fit in fits) for name in names}
    rows = [("model", *names)]
    for fit in fits:
        cells = (f"{fit.distances[n]:.4g}{' *' if fit.distances[n] == best[n] else '  '}" for n in names)
        rows.append((tag_of(type(fit.model)), *cells))
    return "\n".join([*aligned(rows, {1, 2, 3}), "", "* the best model by this metric"])


def _values(fit: Fit) -> Iterator[tuple[str, float, float, str]]:
    """Name, value, standard error of each number, and why it has no error."""
    optimum = fit.optimum
    for each, place in fit.parameters.slices():
        numbers = each.value(optimum.x[place]).tolist()
        for offset, (label, value) in enumerate(zip(each.labels(), numbers, strict=True)):
            at = place.start + offset
            error = float(fit.uncertainty.standard_error[at])
            state = "held" if optimum.chosen[at] else "at its limit" if optimum.at_limit[at] else ""
            unknown = "not determined" if math.isinf(error) else "unknown" if math.isnan(error) else ""
            yield label, value, error, state or unknown


def _ties(fit: Fit) -> list[tuple[str, str]]:
    return sorted(fit.parameters.equal.items())
