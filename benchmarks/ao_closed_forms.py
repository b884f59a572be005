"""Is baked obscurance right where the answer is known, and is its stated error true?

Question   How often does a single estimate's own 95 % interval hold the closed form?
Reference  The obscurance cases of the packaged vectors, built as real triangles
           (jobs/verify/surroundings.py).
Repeats    SCRAMBLES scrambles of every case, the error law from PAIRS pairs of others.

    python benchmarks/ao_closed_forms.py
"""

from __future__ import annotations

import json
import lzma
from collections import defaultdict

import numpy as np

from illumcli.arrays import F, columns
from illumcli.geometry.assemble import place
from illumcli.geometry.mesh import Mesh
from illumcli.jobs.verify.inputs import Inputs
from illumcli.jobs.verify.obscurance import CAST, exponential
from illumcli.jobs.verify.surroundings import surroundings
from illumcli.jobs.verify.vectors import PACKAGED, read_cases
from illumcli.rays.offsets import lifted
from illumcli.rays.tracer import Tracer
from illumcli.visibility.falloffs.step import Step
from illumcli.visibility.obscurance import Errors, Estimates, Method, estimates

SCRAMBLES = 400
PAIRS = 256
BUILT = 2e-5
"""How far the triangles are from the shapes they stand for."""


def main() -> None:
    with lzma.open(PACKAGED) as file:
        known = {case["model"] for case in json.load(file)}
    for samples in (64, 256, 1024):
        rows: dict[str, list[float]] = defaultdict(list)
        squares: dict[str, list[float]] = defaultdict(list)
        for case in read_cases(PACKAGED, known, tuple(CAST)):
            inputs = Inputs(str(PACKAGED), case.id, case.inputs)
            falloff = {
                "ao_visible": lambda inputs: Step(),
                "ao_dmax": lambda inputs: Step(max_distance=inputs.number("d_max")),
                "obscurance": exponential,
            }[case.type](inputs)
            found, law = estimated(surroundings(inputs), falloff, samples)
            off = np.abs(found.w - case.expected[0])
            covered = off <= 1.96 * law.at(found.unevenness, samples) + BUILT
            rows[case.type].append(float(covered.mean()))
            squares[case.type].append(float(np.mean(off**2)))
        for kind, shares in rows.items():
            print(
                f"{samples:5d} rays  {kind:10s} {len(shares):3d} cases  coverage {np.mean(shares):.3f}"
                f" (from {min(shares):.3f} to {max(shares):.3f})  RMSE {np.mean(squares[kind]) ** 0.5:.5f}"
            )
        every = [share for shares in rows.values() for share in shares]
        square = [value for values in squares.values() for value in values]
        print(f"{samples:5d} rays  all        {len(every):3d} cases  coverage {np.mean(every):.3f}"
              f"  RMSE {np.mean(square) ** 0.5:.5f}")  # fmt: skip


def estimated(around, falloff, samples: int) -> tuple[Estimates, Errors]:
    """`SCRAMBLES` estimates at the receiver and their error law."""
    world = place([Mesh.of_triangles(around.vertices, around.triangles)], [np.eye(4)])
    corners = around.vertices[around.triangles[0]]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max() / world.frame.radius
    tracer = Tracer(world.vertices, world.triangles)
    rng = np.random.default_rng(1)

    def cast(count: int) -> Estimates:
        ng = columns(np.tile([0.0, 0.0, 1.0], (count, 1)), F)
        here = np.tile(world.frame.inward(np.zeros(3)), (count, 1))
        origins = lifted(here, ng, np.full(count, edge))
        return estimates(
            tracer, origins, ng, rng.random((2, count)), Method(samples, falloff, world.frame.radius)
        )

    return cast(SCRAMBLES), Errors.of_pairs(cast(PAIRS), cast(PAIRS), samples)


if __name__ == "__main__":
    main()
