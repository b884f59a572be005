"""What the scripts of this folder share: vectors and directions at 50 digits, the file that is written.

A script computes a model from its paper, by other algebra than the package; its file is compared by `illum
verify`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mpmath import atan2, mp, mpf, nstr, sqrt

mp.dps = 50
FOLDER = Path(__file__).parents[3] / "src" / "illumcli" / "data" / "vectors"
Vector = tuple[mpf, mpf, mpf]

# Name -> normal, light, eye, tangent, none of unit length; the tangent is at right angles to the normal.
PLACES: dict[str, tuple[list[float], ...]] = {
    "normal": ([0, 0, 1], [0, 0, 1], [0, 0, 1], [1, 0, 0]),
    "mirror": ([0, 0, 1], [1, 0, 1], [-1, 0, 1], [1, 0, 0]),
    "near_mirror": ([0, 0, 1], [2, 1, 4], [-2, -1, 4.125], [1, 0, 0]),
    "retro": ([0, 0, 1], [1, 1, 1], [1, 1, 1], [1, 0, 0]),
    "general": ([1, 2, 3], [2, -1, 4], [-1, 3, 2], [3, 0, -1]),
    "across": ([0, 1, 0], [1, 2, 0.5], [0.25, 1, -1], [0, 0, 1]),
    "grazing_light": ([0, 0, 1], [1, 0, 0.001], [-0.5, 0.25, 1], [1, 0, 0]),
    "grazing_eye": ([0, 0, 1], [0.25, 0.5, 1], [0, 1, 0.001], [1, 0, 0]),
    "grazing_mirror": ([0, 0, 1], [1, 0, 0.015625], [-1, 0, 0.015625], [0, 1, 0]),
}


def dot(a: Vector, b: Vector) -> mpf:
    return sum(x * y for x, y in zip(a, b, strict=True))


def unit(a: Any) -> Vector:
    exact = [mpf(x) for x in a]
    size = sqrt(sum(x * x for x in exact))
    return tuple(x / size for x in exact)  # type: ignore[return-value]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def half(l: Vector, v: Vector) -> Vector:
    return unit([x + y for x, y in zip(l, v, strict=True)])


def angle(a: Vector, b: Vector) -> mpf:
    """Between directions of unit length."""
    turn = cross(a, b)
    return atan2(sqrt(dot(turn, turn)), dot(a, b))


def color(value: float | list[float]) -> list[mpf]:
    """Three numbers, from one or three."""
    return [mpf(x) for x in (value if isinstance(value, list) else [value] * 3)]


def cases(
    model: str,
    source: str,
    materials: dict[str, dict[str, Any]],
    response: Callable[..., list[mpf]],
) -> Iterator[dict[str, Any]]:
    """Every material at every place; `response` takes its parameters, then n, l, v and t of unit length."""
    for name, parameters in materials.items():
        for place, vectors in PLACES.items():
            expected = response(parameters, *map(unit, vectors))
            yield {
                "id": f"{model}_{name}_{place}",
                "model": model,
                "inputs": {"parameters": parameters, **dict(zip("nlvt", vectors, strict=True))},
                "expected": [float(nstr(x, 20)) for x in expected],
                "rtol": 1e-12,
                "atol": 0,
                "source": source,
            }


def write(model: str, entries: Iterator[dict[str, Any]]) -> None:
    """Write the file of a model, a line for each case."""
    path = FOLDER / f"{model}.json"
    path.write_text("[\n" + ",\n".join(json.dumps(entry) for entry in entries) + "\n]\n")
    print(path, file=sys.stderr)
