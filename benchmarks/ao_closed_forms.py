"""Is baked obscurance right where the answer is known, and is its stated error true?

Question   How often does a single estimate's 95 % interval hold the closed form?
Reference  The obscurance cases of the packaged vectors, built as real triangles
           (verification/surroundings.py).
Repeats    SCRAMBLES scrambles of every case. The error law is that of a bake with one vertex in every case:
           PAIRS pairs of others from each, all cases of a kind together, about as many as a bake of 130,000
           vertices draws. For comparison `own`: a law for each case alone, from OWN pairs of it, which no
           bake has, and `true`: the RMSE of the case itself.

    python benchmarks/ao_closed_forms.py
"""

from __future__ import annotations

import json
import lzma
from dataclasses import dataclass
from typing import Any

import numpy as np

from illumcli.arrays import F, column_major
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import place_meshes
from illumcli.rays.embree import Tracer
from illumcli.rays.offsets import offset_ray_origins
from illumcli.verification.inputs import Inputs
from illumcli.verification.obscurance import CAST, exponential
from illumcli.verification.surroundings import surroundings
from illumcli.verification.vectors import PACKAGED, read_cases
from illumcli.visibility.falloffs.step import Step
from illumcli.visibility.hemisphere import Hemispheres
from illumcli.visibility.obscurance import Method, estimates
from illumcli.visibility.obscurance_error import Errors, Estimates

TEXTBOOK = PACKAGED / "textbook.json.xz"
SCRAMBLES = 400
PAIRS, OWN = 16, 256
BUILT = 2e-5
"""How far the triangles are from the shapes they stand for."""


def main() -> None:
    with lzma.open(TEXTBOOK) as file:
        known = {case["model"] for case in json.load(file)}
    for samples in (64, 256, 1024):
        every: list[np.ndarray] = []
        for kind in CAST:
            found = [estimated(case, samples) for case in read_cases(TEXTBOOK, known, (kind,))]
            every.append(np.array([covered(each, law_of(found, samples), samples) for each in found]))
            tell(samples, kind, every[-1])
        tell(samples, "all", np.concatenate(every))


def tell(samples: int, kind: str, rows: np.ndarray) -> None:
    """Print a line for some cases."""
    pooled, own, true, square, said = rows.T
    print(
        f"{samples:5d} rays  {kind:10s} {len(rows):3d} cases  coverage {pooled.mean():.3f}"
        f" (own {own.mean():.3f}, true {true.mean():.3f})"
        f"  RMSE {square.mean() ** 0.5:.5f}, stated {said.mean() ** 0.5:.5f}"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Estimates of one case."""

    truth: float
    scrambles: Estimates
    a: Estimates
    b: Estimates


def law_of(found: list[Found], samples: int) -> Errors:
    """The error law that a bake with one vertex in every case has."""
    a, b = (
        Estimates(
            *(
                np.concatenate([getattr(half, name)[:PAIRS] for half in halves])
                for name in ("w", "unevenness")
            )
        )
        for halves in ([each.a for each in found], [each.b for each in found])
    )
    return Errors.of_pairs(a, b, samples)


def covered(each: Found, law: Errors, samples: int) -> tuple[float, ...]:
    """Share of the scrambles whose interval holds the truth, by three laws; mean square error, and stated."""
    off = np.abs(each.scrambles.w - each.truth)
    own = Errors.of_pairs(each.a, each.b, samples)
    stated, alone = (rule.at(each.scrambles.neighbor_variation, samples) for rule in (law, own))
    square = np.mean(off**2)
    shares = [np.mean(off <= 1.96 * error + BUILT) for error in (stated, alone, square**0.5)]
    return (*map(float, shares), float(square), float(np.mean(np.square(stated, dtype=float))))


def estimated(case: Any, samples: int) -> Found:
    """`SCRAMBLES` estimates at the receiver and `OWN` pairs of others."""
    inputs = Inputs(str(TEXTBOOK), case.id, case.inputs)
    falloff = {
        "ao_visible": lambda: Step(),
        "ao_dmax": lambda: Step(max_distance=inputs.number("d_max")),
        "obscurance": lambda: exponential(inputs),
    }[case.type]()
    around = surroundings(inputs)
    geometry = place_meshes([Mesh.of_triangles(around.vertices, around.triangles)], [np.eye(4)])
    corners = around.vertices[around.triangles[0]]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max() / geometry.render_space.radius
    tracer = Tracer(geometry.vertices, geometry.triangles)
    rng = np.random.default_rng(1)

    def cast(count: int) -> Estimates:
        ng = column_major(np.tile([0.0, 0.0, 1.0], (count, 1)), F)
        here = np.tile(geometry.render_space.from_world(np.zeros(3)), (count, 1))
        origins = offset_ray_origins(here, ng, np.full(count, edge))
        method = Method(samples, falloff, geometry.render_space.radius)
        return estimates(tracer, Hemispheres(ng, origins), rng.random((2, count)), method)

    return Found(case.expected[0], cast(SCRAMBLES), cast(OWN), cast(OWN))


if __name__ == "__main__":
    main()
