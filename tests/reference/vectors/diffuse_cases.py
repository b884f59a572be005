"""Directions of the cases of `fujii`, `eon` and `lafortune`, and the writer of their files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

from _cases import FOLDER, dot, unit
from mpmath import mpf, sqrt

DIRECTIONS: dict[str, tuple[list[float], list[float], list[float]]] = {
    "all along the normal": ([0, 0, 1], [0, 0, 1], [0, 0, 1]),
    "light along the normal": ([0, 0, 1], [0, 0, 1], [1, 2, 2]),
    "mirrored": ([0, 0, 1], [0.6, 0, 0.8], [-0.6, 0, 0.8]),
    "towards the light": ([0, 0, 1], [0.6, 0, 0.8], [0.6, 0, 0.8]),
    "a quarter turn apart": ([0, 0, 1], [0.6, 0, 0.8], [0, 0.8, 0.6]),
    "one side": ([0, 0, 1], [3, 1, 1], [1, 2, 0.4]),
    "opposite sides": ([0, 0, 1], [3, 1, 1], [-1, -2, 0.4]),
    "light at grazing": ([0, 0, 1], [1, 0.2, 1e-4], [0.3, 0.4, 1]),
    "eye at grazing": ([0, 0, 1], [0.3, 0.4, 1], [1, 0.2, 1e-6]),
    "towards the light at grazing": ([0, 0, 1], [1, 0.1, 1e-3], [1, 0.1, 2e-3]),
    "mirrored at grazing": ([0, 0, 1], [1, 0, 1e-3], [-1, 0, 1e-3]),
    "near the normal": ([0, 0, 1], [1e-5, 2e-5, 1], [3e-5, -1e-5, 1]),
    "slanted": ([0.2, -0.5, 1], [0.7, 0.1, 0.6], [-0.3, 0.4, 1.1]),
    "slanted, one side": ([-1, 2, 0.5], [-0.2, 1, 0.9], [-0.5, 0.8, 1.4]),
}


def write(model: str, source: str, cases: Iterator[tuple[str, dict[str, Any], list[mpf]]]) -> None:
    """The file of a model, from the note, the inputs and the response of each case."""
    entries = [
        {
            "id": f"{model}-{number:03}",
            "model": model,
            "inputs": inputs,
            "expected": [float(x) for x in expected],
            "source": source,
            "note": note,
            "quantity": "response",
            "rtol": 1e-12,
            "atol": 0,
        }
        for number, (note, inputs, expected) in enumerate(cases, 1)
    ]
    (FOLDER / f"{model}.json").write_text(json.dumps(entries, indent=1) + "\n")


def cases(
    parameters: list[dict[str, Any]],
    response: Callable[..., list[mpf]],
    tangent: list[float] | None = None,
) -> Iterator[tuple[str, dict[str, Any], list[mpf]]]:
    """Every direction with two of the parameters in turn, and every parameter at two directions."""
    pairs = [
        (note, parameters[(k + step) % len(parameters)])
        for k, note in enumerate(DIRECTIONS)
        for step in (0, len(parameters) // 2)
    ]
    pairs += [(note, each) for each in parameters for note in ("one side", "opposite sides")]
    seen = []
    for pair in pairs:
        if pair in seen:
            continue
        seen.append(pair)
        note, given = pair
        n, l, v = DIRECTIONS[note]
        inputs: dict[str, Any] = {"parameters": given, "n": n, "l": l, "v": v}
        axes = [unit(n), unit(l), unit(v)]
        if tangent is not None:
            inputs["t"] = tangent
            raw, normal = unit(tangent), axes[0]
            across = [t - dot(raw, normal) * x for t, x in zip(raw, normal, strict=True)]
            axes.append([x / sqrt(dot(across, across)) for x in across])
        yield note, inputs, response(given, *axes)
