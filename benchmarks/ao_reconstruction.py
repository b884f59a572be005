"""How many rays does reconstruction at vertices save, and is the error that it states true?

Question   What is the root mean square error of baked obscurance, raw and reconstructed, how far from it is
           the error that the audit states, how often does its 95 % interval hold it, and how often does that
           of a vertex hold the vertex's truth?
Reference  Two estimates of REFERENCE rays at every vertex, of other scrambles, each multiplied with the
           other: their own error cancels in the mean.
Repeats    One bake for each of --seeds seeds.

    python benchmarks/ao_reconstruction.py [--seeds 20] [--reference 2048] [--rays 4 16 64 256] MESH...
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from ao_error import caster
from illumcli.baking.audit import Audited, audit
from illumcli.baking.reconstruction import RawValues, reconstruct, rotated_cells
from illumcli.baking.sampling import BakeSampler, RayCounts


def row(path: Path, rays: int, seeds: int, truth: list[np.ndarray]) -> str:
    """Figures of one mesh at one number of rays."""
    raw, error, stated, inside, covered, audits, seconds = [], [], [], [], [], [], []
    for seed in range(seeds):
        plain, closed = caster(path, seed=seed)
        sampler = replace(plain, is_dithered=True)
        counts = RayCounts(closed, np.full(len(closed), rays))
        values = sampler.estimate("values", counts, 0).values
        law = sampler.errors(counts, 1 << 20).law
        hidden, variance = np.zeros(len(sampler.points.key)), np.zeros(len(sampler.points.key))
        hidden[closed] = 1 - values.w.astype(float)
        variance[closed] = law.at(values.neighbor_variation, rays).astype(float) ** 2

        start = time.process_time()
        made = reconstruct(sampler.points, rotated_cells(sampler.points, 1), RawValues(hidden, variance), 1)
        seconds.append(time.process_time() - start)
        w, risk = 1 - made.hidden[closed], made.risk[closed]
        found = audit(sampler, Audited(closed, w, risk, rays, float(variance[closed].mean())), 0)

        off = [w - half for half in truth]
        raw.append(np.sqrt(np.mean((values.w - truth[0]) * (values.w - truth[1]))))
        error.append(np.sqrt(np.mean(off[0] * off[1])))
        stated.append(found.rmse(1))
        low, high = found.interval(1)
        inside.append(low <= error[-1] <= high)
        covered.append(np.mean(np.abs(off[0] + off[1]) / 2 <= 1.96 * found.law.at(risk)))
        audits.append(found.rays / (rays * len(closed)))
    ratio = np.array(stated) / error
    return (
        f"{rays:5d} {np.mean(raw):9.4f} {np.mean(error):13.4f} {ratio.mean():12.3f} ({ratio.min():.2f} .. "
        f"{ratio.max():.2f}) {np.mean(inside):9.2f} {np.mean(covered):10.3f} {np.mean(audits):11.2f} "
        f"{np.mean(seconds) / len(hidden) * 1e6:10.1f}"
    )


def reference(sampler: BakeSampler, closed: np.ndarray, rays: int) -> list[np.ndarray]:
    """Two estimates of w at every point that is not open."""
    counts = RayCounts(closed, np.full(len(closed), rays))
    return [sampler.estimate("reference", counts, (1 << 29) + half).values.w.astype(float) for half in (0, 1)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--reference", type=int, default=2048)
    parser.add_argument("--rays", type=int, nargs="+", default=[4, 16, 64, 256])
    parser.add_argument("--small", action="store_true", help="to see that it runs")
    chosen = parser.parse_args()
    for path in chosen.meshes:
        sampler, closed = caster(path)
        truth = reference(sampler, closed, chosen.reference)
        print(f"{path.name}: {len(closed)} vertices and normals that cast rays")
        print(
            " rays       raw reconstructed stated / true (least .. most) in interval  covered audit rays "
            "us a vertex"
        )
        for rays in chosen.rays:
            print(row(path, rays, chosen.seeds, truth), flush=True)


if __name__ == "__main__":
    main()
