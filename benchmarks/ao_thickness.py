"""How large are the errors of baked thickness and bent normals, and what do they cost beside w?

Question   What is the root mean square error of thickness, how far from it is the stated one, how often does
           the 95 % interval of a vertex hold its truth? By what angle are bent normals off? How many times as
           long as a bake of w does a bake take that adds bent normals, or of thickness alone?
Reference  A bake of REFERENCE rays with another seed, whose error is a tenth of that of 256 rays.
Repeats    One bake for each of --seeds seeds; times are medians of processor time, of bakes in turns.

    python benchmarks/ao_thickness.py [--seeds 4] [--rays 16 64 256] MESH...
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from _bench import header
from illumcli.baking.bake import bake_mesh
from illumcli.baking.report import BakeReport
from illumcli.baking.settings import BakeOptions, BakeSettings
from illumcli.visibility.baked import read_npz
from illumcli.visibility.channels import Arrays

REFERENCE = 4096
EVERYTHING = ("ao", "bent_normal", "thickness")


def baked(path: Path, folder: Path, **settings: object) -> tuple[Arrays, BakeReport, float]:
    """The channels of a bake, its report, and seconds of processor."""
    out = folder / "out.npz"
    start = time.process_time()
    _, report = bake_mesh(path, [out], BakeSettings(**settings), BakeOptions(force=True))
    return read_npz(out).channels, report, time.process_time() - start


def row(path: Path, folder: Path, truth: Arrays, rays: int, reconstruct: bool, seeds: int) -> str:
    """Figures of one mesh at one number of rays."""
    errors, ratios, covered, angles = [], [], [], []
    cast = truth["thickness_error"] > 0
    for seed in range(seeds):
        settings = {"samples": rays, "seed": seed, "reconstruct": reconstruct}
        channels, report, _ = baked(path, folder, what=EVERYTHING, **settings)
        off = (channels["thickness"] - truth["thickness"])[cast].astype(float)
        errors.append(np.sqrt(np.mean(off**2)))
        sampled = report.sampled["thickness"]
        ratios.append(sampled.rmse * (1 + sampled.open / sampled.cast) ** 0.5 / errors[-1])
        covered.append(np.mean(np.abs(off) <= 1.96 * channels["thickness_error"][cast]))
        cosine = np.einsum("ij,ij->i", channels["bent_normal"], truth["bent_normal"])[cast]
        angles.append(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2))))
    share = np.mean(errors) / truth["thickness"][cast].mean()
    return (
        f"{rays:5d} {'yes' if reconstruct else 'no':>13} {share:10.4f} {np.mean(ratios):14.3f} "
        f"{np.mean(covered):10.3f} {np.mean(angles):10.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--rays", type=int, nargs="+", default=[16, 64, 256])
    chosen = parser.parse_args()
    header("How large are the errors of thickness and bent normals?", reference=REFERENCE, seeds=chosen.seeds)
    with tempfile.TemporaryDirectory() as name:
        for path in chosen.meshes:
            folder = Path(name)
            truth, _, _ = baked(path, folder, what=EVERYTHING, samples=REFERENCE, seed=1000)
            print(f"{path.name}: mean thickness {truth['thickness'].mean():.4g}")
            print(" rays reconstructed error / mean stated / true    covered  bent [deg]")
            for rays in chosen.rays:
                for reconstruct in (False, True):
                    print(row(path, folder, truth, rays, reconstruct, chosen.seeds), flush=True)
            kinds = (("ao",), ("ao", "bent_normal"), ("thickness",))
            seconds = [[baked(path, folder, what=kind, samples=256)[2] for kind in kinds] for _ in range(5)]
            ao, bent, thickness = np.median(seconds, axis=0)
            print(f"seconds / ao alone: ao and bent normals {bent / ao:.2f}, thickness {thickness / ao:.2f}")


if __name__ == "__main__":
    main()
