"""Scale invariance: the same scene at any size and distance from the origin gives the same image."""

from __future__ import annotations

from itertools import product

import numpy as np

from illumcli.stress.sandbox import Channels, CheckResult, Sandbox
from illumcli.stress.scenes import Scene, scaled, scene

SCALES = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6)
DISTANCES = (0.0, 1e2, 1e4, 1e6)
"""Distances from the origin along a diagonal, in radii."""
LAYERS = ("beauty", "obscurance", "alpha")
RAYS = 16
BEYOND = 1e-3
"""Share of pixels that may differ: their rays pass edges by less than the rounding of the vertices."""


def check_scale(sandbox: Sandbox, quick: bool) -> list[CheckResult]:
    """All sizes and distances, powers of two of both, and bodies without occluders."""
    pairs = list(product(SCALES, DISTANCES))
    chosen = pairs[:: 5 if quick else 1]
    film = {"width": 32, "height": 24, "samples": 1} if quick else {"width": 96, "height": 72, "samples": 1}
    return [
        _matrix(sandbox, chosen, film),
        _baked(sandbox, chosen),
        _powers_of_two(sandbox, (-20, 7) if quick else range(-20, 21, 4), film),
        *_convex(sandbox, chosen, film),
    ]


def _matrix(sandbox: Sandbox, pairs: list[tuple[float, float]], film: Scene) -> CheckResult:
    reference = _view(sandbox, 1.0, 0.0, film)
    most, where = 0.0, (1.0, 0.0)
    for size, distance in pairs:
        share = _beyond(reference, _view(sandbox, size, distance, film))
        if share > most:
            most, where = share, (size, distance)
    check = f"{len(pairs)} pairs of size and distance: |dw| <= 1/{RAYS}, light within 1e-4 of the brightest"
    worst = (
        f"{most:.2%} of pixels differ, size {where[0]:g} at {where[1]:g} radii"
        if most
        else "no pixel differs"
    )
    return CheckResult("size and distance", check, worst, most <= BEYOND)


def _view(sandbox: Sandbox, size: float, distance: float, film: Scene) -> Channels:
    description = {**_there(size, distance), "film": film, "obscurance": {"samples": RAYS}}
    return sandbox.render(description, LAYERS)[0]


def _baked(sandbox: Sandbox, pairs: list[tuple[float, float]]) -> CheckResult:
    reference = sandbox.bake(_there(1.0, 0.0), RAYS)
    most, where = 0.0, (1.0, 0.0)
    for size, distance in pairs:
        off = float(np.abs(sandbox.bake(_there(size, distance), RAYS) - reference).max())
        if off > most:
            most, where = off, (size, distance)
    check = f"{len(pairs)} pairs of size and distance: |dw| <= 1/{RAYS} at every vertex"
    worst = f"|dw| {most:.3g} at most, of {len(reference)} vertices"
    if most:
        worst += f", size {where[0]:g} at {where[1]:g} radii"
    return CheckResult(
        "size and distance, baked", check, worst, bool(most <= 1.01 / RAYS and reference.min() < 0.9)
    )


def _there(size: float, distance: float) -> Scene:
    """Ball and floor of a size, at a distance in radii from the origin; the scene's radius is about 5."""
    return scaled(size, *(5 * size * distance,) * 3)


def _beyond(a: Channels, b: Channels) -> float:
    """Share of pixels that differ by more than rounding."""
    wrong = np.abs(a["obscurance.Y"] - b["obscurance.Y"]) > 1.01 / RAYS
    for name in "RGB":
        wrong |= np.abs(a[name] - b[name]) > 1e-4 * a[name].max()
    return float(wrong.mean())


def _powers_of_two(sandbox: Sandbox, exponents: range | tuple[int, ...], film: Scene) -> CheckResult:
    reference = _view(sandbox, 1.0, 0.0, film)
    different = 0
    for exponent in exponents:
        other = _view(sandbox, 2.0**exponent, 0.0, film)
        different += sum(
            int(np.count_nonzero(reference[name] != other[name])) for name in ("A", "obscurance.Y")
        )
    check = "scaled by powers of two, w and coverage are the same bits"
    return CheckResult("powers of two", check, f"{different} values differ", different == 0)


BODIES: dict[str, Scene] = {
    "plane": {"mesh": {"shape": "plane", "size": [2, 2]}},
    "box": {"mesh": {"shape": "box"}},
    "ball": {"mesh": {"shape": "sphere", "segments": 80, "rings": 40}},
    "needle 1000:1": {"mesh": {"shape": "sphere"}, "transform": {"scale": [1, 1e-3, 1e-3]}},
    "cone": {"mesh": {"shape": "cone"}},
}


def _convex(sandbox: Sandbox, pairs: list[tuple[float, float]], film: Scene) -> list[CheckResult]:
    """On convex bodies w is exactly 1, at any size and distance."""
    results = []
    for name, body in BODIES.items():
        pixels = shaded = 0
        for size, distance in pairs:
            away = size * distance
            scale = body.get("transform", {}).get("scale", [1, 1, 1])
            placed = {**body, "transform": {"scale": [size * s for s in scale], "translate": [away] * 3}}
            camera = {
                "position": [away + 0.9 * size, away + 0.7 * size, away + 4 * size], "target": [away] * 3,
                "fov": 1 if "needle" in name else 35,
            }  # fmt: skip
            description = scene(placed, lights=[], camera=camera, film=film, obscurance={"samples": 64})
            channels, _ = sandbox.render(description, ("obscurance", "alpha"))
            seen = channels["A"] == 1
            pixels += int(np.count_nonzero(seen))
            shaded += int(np.count_nonzero(channels["obscurance.Y"][seen] != 1))
        check = f"w = 1 exactly, {len(pairs)} sizes and distances"
        results.append(
            CheckResult(f"open: {name}", check, f"{shaded} of {pixels} pixels", shaded == 0 < pixels)
        )
    return results
