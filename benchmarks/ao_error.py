"""How large is the error of a baked value, and is the stated error true? Errors, coverage, target error.

Question   How does the error of baked obscurance fall with the rays, how much less is it than that of
           independent rays, how often does a vertex's own interval hold the truth, and does
           --target-error keep its word?
Reference  REFERENCE rays a vertex of other scrambles, by the same spiral, whose own error is a seventh
           of that at 1024 rays.
Repeats    VERTICES vertices drawn by a fixed seed, each with a scramble of its own.

    python benchmarks/ao_error.py [--figure docs/obscurance.svg] [--ground y] MESH...
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

from illumcli.baking.loading import mesh_alone, surfaces_of
from illumcli.baking.measures import Measure
from illumcli.baking.occluders import occluders_of
from illumcli.baking.sampling import BakeSampler, RayCounts
from illumcli.baking.settings import BakeSettings
from illumcli.baking.vertex_points import vertex_points
from illumcli.progress import no_progress
from illumcli.visibility.obscurance import Method

COUNTS = (16, 64, 256, 1024)
REFERENCE = 32768
VERTICES = 800


def caster(
    path: Path, sampler: str = "spiral", seed: int = 0, ground: str | None = None
) -> tuple[BakeSampler, np.ndarray]:
    """The bake of a mesh alone, and the points that cast rays."""
    loaded = mesh_alone(path)
    scene = loaded.scene
    surfaces, _ = surfaces_of(scene, loaded)
    geometry = surfaces.geometry
    settings = BakeSettings(sampler=sampler, ground=ground)
    vertices = vertex_points(surfaces)
    method = Method(256, settings.obscurance().falloff, geometry.render_space.radius, sampler)
    threads = len(os.sched_getaffinity(0))
    made = BakeSampler(
        vertices.points,
        occluders_of(scene.object_names(), geometry, settings, {}),
        Measure(method),
        seed,
        threads,
        no_progress,
    )
    return made, np.flatnonzero(~made.open_points())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--ground", choices=("x", "y", "z"), help="up axis")
    chosen = parser.parse_args()
    curves = {}
    for path in chosen.meshes:
        own, lanes = caster(path, ground=chosen.ground)
        few = np.sort(np.random.default_rng(0).permutation(lanes)[:VERTICES])
        counts = RayCounts(few, np.full(len(few), REFERENCE))
        truth = own.estimate("reference", counts, 1 << 30).values.w.astype(float)
        print(f"{path.name}: {len(few)} of {len(lanes)} vertices that cast rays, mean w {truth.mean():.3f}")
        print("  rays     spiral     random  ratio   owen ratio   said  coverage of 95 %")
        errors: dict[str, list[float]] = {"spiral": [], "random": [], "owen": []}
        for count in COUNTS:
            rays = np.full(len(few), count)
            for sampler in errors:
                bake, _ = caster(path, sampler, count, chosen.ground)
                found = bake.estimate("values", RayCounts(few, rays), 0).values
                off = found.w - truth
                errors[sampler].append(float(np.sqrt(np.mean(off**2))))
                if sampler == "spiral":
                    law = bake.errors(RayCounts(lanes, np.full(len(lanes), count)), 7).law
                    said = law.at(found.neighbor_variation, count)
                    covered = np.mean(np.abs(off) <= 1.96 * said)
            s, r, o = (errors[name][-1] for name in ("spiral", "random", "owen"))
            row = f"{count:5d} {s:10.5f} {r:10.5f}  {s / r:.3f}       {o / r:.3f} {law.rmse:.5f}"
            print(f"  {row}  {covered:.3f}")
        slope = np.polyfit(np.log(COUNTS), np.log(errors["spiral"]), 1)[0]
        print(f"  slope of the spiral {slope:.3f}")
        curves[path.stem] = errors
        bake, _ = caster(path, seed=5, ground=chosen.ground)
        chosen_samples = bake.samples_for(lanes, 1.0, 0.005)
        samples = chosen_samples.samples
        place = np.searchsorted(lanes, few)
        found = bake.estimate("values", RayCounts(few, samples[place]), 0).values
        off = found.w - truth
        rmse, standard = np.sqrt(np.mean(off**2)), off.std() / len(off) ** 0.5
        uniform = np.exp(np.interp(np.log(1 / rmse), np.log(1 / np.array(errors["spiral"])), np.log(COUNTS)))
        thrown = chosen_samples.pilot_rays + chosen_samples.error_rays
        print(
            f"  target 0.005: reached {rmse:.5f}, mean error {off.mean():+.1e} +- {standard:.1e}; "
            f"{samples.mean():.0f} rays a vertex kept, {thrown / len(lanes):.0f} to decide; "
            f"uniform sampling needs {uniform:.0f} for the same error"
        )
    if chosen.figure:
        draw(curves, chosen.figure)


def draw(curves: dict[str, dict[str, list[float]]], path: Path) -> None:
    """Error against rays, both logarithmic."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    plt.rcParams["svg.hashsalt"] = "illum"
    figure, axes = plt.subplots(figsize=(5.2, 3.6), layout="constrained")
    styles = {"spiral": "-", "owen": "--", "random": ":"}
    for number, (mesh, errors) in enumerate(curves.items()):
        for sampler, values in errors.items():
            label = f"{mesh}, {sampler}"
            axes.loglog(COUNTS, values, styles[sampler], color=f"C{number}", marker="o", ms=3, label=label)
    axes.set_xticks(COUNTS, [str(count) for count in COUNTS])
    axes.minorticks_off()
    axes.set(xlabel="rays a vertex", ylabel="root mean square error of obscurance")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
