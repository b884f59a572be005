"""Claims of illumination models, checked at random directions, with random parameters.

Each check returns the largest deviation from what is claimed and where it was.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from illumcli.arrays import Vectors, column_major, cross, dot, unit
from illumcli.models._base import IlluminationModel
from illumcli.records import Record
from illumcli.shading.terms import evaluate
from illumcli.verification.drawn import drawn, with_values
from illumcli.verification.single import shortened

DIRECTIONS = 64
COSINES = (1.0, 0.7, 0.3, 0.05)
"""At the light, where the reflected share is integrated."""
GRIDS = ((48, 64), (96, 128), (192, 256))
"""Nodes over the height and the azimuth of the eye, until two integrals agree."""
AGREE = 1e-3
TOLERANCES = {"light": 0.0, "reciprocal": 1e-7, "isotropic": 1e-7, "conserving": 2e-3}
"""Largest deviation by claim. `light`: the share of values that are negative or not finite, of each model."""
DRAWS = {"light": 60, "reciprocal": 60, "isotropic": 20, "conserving": 3}
"""Sets of random parameters."""


class ClaimResult(Record):
    """A claim of a model or material."""

    name: str
    claim: str
    checked: int
    """Sets of parameters."""
    skipped: int
    """Sets of parameters whose lobes are too narrow for the quadrature."""
    worst: float
    """The largest deviation; for `conserving` the largest reflected share minus 1; minus infinity if nothing
    could be told."""
    where: str
    """The parameters and cosines of the largest deviation."""

    @property
    def allowed(self) -> float:
        """The largest deviation that passes."""
        return TOLERANCES[self.claim]

    @property
    def passed(self) -> bool:
        return self.worst <= self.allowed


def claims_of(name: str, model: IlluminationModel, is_fixed: bool, seed: int = 1) -> list[ClaimResult]:
    """A result for everything that a model claims that can be checked.

    Parameters
    ----------
    name : str
        Of the model, or of the material.
    is_fixed : bool
        Keep the model's parameters, except those that vary over a surface; otherwise draw all numbers.
    """
    claimed = model.claimed()
    results = []
    for claim, tolerance in TOLERANCES.items():
        if claim != "light" and claim not in claimed:
            continue
        random = np.random.default_rng(seed)
        checked = skipped = 0
        worst, where = -np.inf, ""
        varies = bool(model.varying())
        for _ in range(1 if is_fixed and not varies else DRAWS[claim]):
            one = with_values(model, random) if is_fixed else drawn(model, random)
            for deviation, place in _deviations(claim, one, int(random.integers(1 << 31))):
                if deviation is None:
                    skipped += 1
                    break
                if not deviation <= worst:
                    worst, where = deviation, place
                    if not is_fixed:
                        where += f" with {shortened(one.model_dump())}"
            checked += 1
        where = where if not worst <= tolerance else ""
        results.append(ClaimResult(name, claim, checked - skipped, skipped, worst, where))
    return results


def _deviations(claim: str, model: IlluminationModel, seed: int) -> Iterator[tuple[float | None, str]]:
    """Deviations and where they are; None if the quadrature does not resolve the lobes."""
    match claim:
        case "light":
            wrong = wrong_share(model, directions(seed, 4 * DIRECTIONS))
            yield wrong, f"{100 * wrong:.2g} % of values"
        case "reciprocal":
            yield reciprocity(model, directions(seed, DIRECTIONS, least=1e-3))
        case "isotropic":
            given = directions(seed, DIRECTIONS, least=1e-3)
            yield isotropy(model, given, np.random.default_rng(seed).uniform(0, 2 * np.pi))
        case "conserving":
            for cosine in COSINES:
                for turn in (0.0, 0.8) if model.has_grain() else (0.0,):
                    share = reflected_share(model, cosine, turn)
                    yield (None if share is None else float(share.max()) - 1), f"n.l = {cosine:g}"


# --- the checks -------------------------------------------------------------------------------------------


def response(model: IlluminationModel, given: Mapping[str, Any]) -> Vectors:
    """(N, 3) the sum of all lobes."""
    return np.asarray(sum(evaluate(model.lobes(), dict(given)).values(), np.zeros_like(given["l"])))


def wrong_share(model: IlluminationModel, given: Mapping[str, Any]) -> float:
    """The share of values that are negative or not finite."""
    wrong, count = Counter[str](), 0
    for values in evaluate(model.lobes(), dict(given), wrong).values():
        count += values.size
        wrong["tested"] += int(np.count_nonzero(~((values >= 0) & np.isfinite(values))))
    return wrong.total() / max(count, 1)


def reciprocity(model: IlluminationModel, given: Mapping[str, Any]) -> tuple[float, str]:
    """The largest relative change of response / n_l if light and eye are exchanged, and where.

    A lobe is kept precise where it is high: 1 minus its base is summed, and differs in its last bits. So
    values below 1e-5 of the highest count as that.
    """
    swapped = {**given, "l": given["v"], "v": given["l"]}
    n_l, n_v = dot(given["n"], given["l"]), dot(given["n"], given["v"])
    there = response(model, given) / n_l[:, None]
    back = response(model, swapped) / n_v[:, None]
    return _largest(np.abs(there - back), np.abs(back), n_l, n_v)


def isotropy(model: IlluminationModel, given: Mapping[str, Any], angle: float) -> tuple[float, str]:
    """The largest relative change if light and eye are turned about the normal, and where."""
    one, other = response(model, given), response(model, turned(given, angle))
    return _largest(
        np.abs(one - other), np.abs(one), dot(given["n"], given["l"]), dot(given["n"], given["v"])
    )


def _largest(
    difference: NDArray[Any], size: NDArray[Any], n_l: NDArray[Any], n_v: NDArray[Any]
) -> tuple[float, str]:
    relative = difference / np.maximum(size, max(1e-5 * size.max(initial=0), 1e-8))
    row = int(relative.max(axis=1).argmax())
    return float(relative[row].max()), f"n.l = {n_l[row]:.3g}, n.v = {n_v[row]:.3g}"


def reflected_share(model: IlluminationModel, cosine: float, turn: float = 0.0) -> NDArray[Any] | None:
    """(3,) share of the light from a direction that is reflected; None if lobes are too narrow to tell."""
    before = None
    for grid in GRIDS:
        share = _integral(model, cosine, turn, *grid)
        if before is not None and np.abs(share - before).max() < AGREE:
            return share
        before = share
    return None


def _integral(
    model: IlluminationModel, cosine: float, turn: float, heights: int, azimuths: int
) -> NDArray[np.float64]:
    """The integral of response / n_l * n_v over all directions of the eye."""
    node, weight = np.polynomial.legendre.leggauss(heights)
    u, phi = (1 + node) / 2, (np.arange(azimuths) + 0.5) / azimuths * 2 * np.pi
    x, p = (grid.ravel() for grid in np.meshgrid(u, phi, indexing="ij"))
    height = x * x  # more nodes at grazing
    level = np.sqrt(1 - height**2)
    sine = np.sqrt(1 - cosine**2)
    count = len(x)
    given = {
        "v": column_major(np.stack([level * np.cos(p), level * np.sin(p), height], 1)),
        "l": column_major(np.tile([sine * np.cos(turn), sine * np.sin(turn), cosine], (count, 1))),
        "n": column_major(np.tile([0.0, 0.0, 1.0], (count, 1))),
        "t": column_major(np.tile([1.0, 0.0, 0.0], (count, 1))),
        "light": np.ones(3),
    }
    area = np.repeat(weight / 2 * 2 * u, azimuths) * 2 * np.pi / azimuths
    return np.asarray((area * height / cosine) @ response(model, given), np.float64)


# --- directions -------------------------------------------------------------------------------------------


def directions(
    seed: int, count: int, dtype: DTypeLike = np.float64, least: float = 0.0
) -> dict[str, NDArray[Any]]:
    """At most `count` unit n, t, l, v with n.l > 0: general ones, grazing, mirrored, retro-reflected, below.

    With `least` > 0, light and eye are at least that cosine above the surface.
    """
    random = np.random.default_rng(seed)
    n = unit(column_major(random.normal(size=(count, 3))))
    t = unit(cross(n, unit(column_major(random.normal(size=(count, 3))))))
    b = cross(n, t)

    def above() -> Vectors:
        height = (
            random.random(count) if least else random.choice([1e-7, 1e-4, 1.0], count) * random.random(count)
        )
        height = least + (1 - least) * height
        turn = random.random(count) * 2 * np.pi
        level = np.sqrt((1 - height) * (1 + height))
        return column_major(
            height[:, None] * n + (level * np.cos(turn))[:, None] * t + (level * np.sin(turn))[:, None] * b
        )

    l, v = above(), above()
    kind = random.integers(0, 6, count)
    mirrored = 2 * dot(n, l)[:, None] * n - l
    v[kind == 1] = mirrored[kind == 1]
    v[kind == 2] = (
        unit(mirrored + 1e-3 * random.normal(size=(count, 3)))[kind == 2] if not least else v[kind == 2]
    )
    v[kind == 3] = l[kind == 3]
    if not least:
        v[kind == 4] -= (1.5 * dot(n, v))[kind == 4][:, None] * n[kind == 4]
        v[kind == 5] = n[kind == 5]
        v = unit(v)
    given = {"n": n, "t": t, "l": l, "v": v}
    given = {name: column_major(value.astype(dtype)) for name, value in given.items()}
    lit = dot(given["n"], given["l"]) > 0
    given = {name: column_major(value[lit]) for name, value in given.items()}
    return given | {"light": np.array([1, 0.5, 0.25], dtype)}


def turned(given: Mapping[str, NDArray[Any]], angle: float) -> dict[str, NDArray[Any]]:
    """Light and eye turned about the normal."""
    n = given["n"]

    def turn(w: Vectors) -> Vectors:
        along = dot(n, w)[:, None] * n
        return column_major(along + np.cos(angle) * (w - along) + np.sin(angle) * cross(n, w))

    return {**given, "l": turn(given["l"]), "v": turn(given["v"])}
