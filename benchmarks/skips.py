"""What does each skip save? Rays and evaluations in a scene that suits it, with the skip and without.

A skip is turned off by putting a function in the place of the one that decides. Both pictures must agree in
every value. `python benchmarks/skips.py [WIDTH]`; figures are counts and do not depend on the machine.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from illumcli.arrays import dot
from illumcli.lights import _incident as light_at
from illumcli.lights._incident import LitPoints
from illumcli.models._base import IlluminationModel
from illumcli.render_graph import culling, needs
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import RenderStats, Run, bands, run_once
from illumcli.render_graph.pipeline import place_and_cull
from illumcli.render_graph.schedule import outputs_of, schedule
from illumcli.scene.load import load
from illumcli.shading import direct

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: WIDTH, height: WIDTH, samples: 2}
ambient: 0.3
obscurance: {samples: 16}
materials:
  clay: {model: blinn_phong, diffuse: [0.8, 0.2, 0.1], specular: 0.4, exponent: 20}
  grey: {model: lambert, diffuse: 0.7}
objects:
  - {mesh: {shape: plane, size: [6, 6]}, material: grey}
  - {name: ball, mesh: {shape: sphere, radius: 0.5}, material: clay, transform: {translate: [0, 0.5, 0]}}
lights:
  - {light: point, name: key, position: [2, 3, 2], intensity: 9}
  - {light: spot, name: rim, position: [-2, 3, -1], target: [0, 0, 0], angle: 14, intensity: 20}
"""


AWAY = """
  - {name: away, mesh: {shape: sphere, radius: 0.5}, material: clay, transform: {translate: [7, 0.5, 6]}}
"""


@dataclass(frozen=True)
class Skip:
    """A skip, the scene that shows it, and how it is turned off."""

    name: str
    overrides: tuple[str, ...] = ()
    off: tuple[tuple[object, str, object], ...] = ()
    layers: tuple[str, ...] = ("beauty",)
    layers_off: tuple[str, ...] | None = None
    objects: str = ""
    """More of them."""


def everywhere(light, render_space, points, ray_order=None):
    """Every point is asked about, those that get nothing with scale 0."""
    sample = light.sample_at(points.position, render_space)
    reached = (sample.irradiance_scale > 0) & (dot(points.n, sample.l) > 0)
    scale = np.where(reached, sample.irradiance_scale, 0).astype(np.float32)
    index = np.arange(len(points.position), dtype=np.int32)
    return LitPoints(index, len(index), sample.l, sample.distance, scale)


def dimmed(incident, shadow):
    """Every lit point is evaluated, those in shadow with scale 0."""
    return replace(incident, irradiance_scale=incident.irradiance_scale * shadow.take(incident.index))


def yes(*_):
    return True


def no(*_):
    return False


def _directions(_):
    return frozenset("nlvt")


DARK = ((needs, "is_on", yes),)
AMBIENT = ((needs, "is_ambient", yes),)
SKIPS = (
    Skip("lights of intensity 0", ("lights.rim.intensity=0",), DARK),
    Skip("points a light does not reach", (), ((light_at, "incident", everywhere),)),
    Skip("points in shadow", (), ((light_at, "unshadowed", dimmed),)),
    Skip("lobes that are black", ("materials.clay.specular=0",), ((IlluminationModel, "_is_always", no),)),
    Skip("ambient light of 0", ("ambient=0",), AMBIENT),
    Skip("k_a of 0", ("materials.clay.ambient=0", "materials.grey.ambient=0"), AMBIENT),
    Skip("emission of 0", (), ((needs, "is_emissive", yes),)),
    Skip("directions nobody reads", ("objects.ball.material=grey",), ((needs, "needed_terms", _directions),)),
    Skip("layers nobody asks for", (), (), ("depth",), ("depth", "beauty")),
    Skip(
        "objects no view can tell",
        ("obscurance.falloff={falloff: smooth, max_distance: 1}",),
        ((culling, "unaffecting", lambda *_: ()),),
        objects=AWAY,
    ),
    Skip("ids alone", (), (), ("object_id",), ("object_id", "beauty")),
)


def render(path: Path, skip: Skip, layers: tuple[str, ...]) -> tuple[dict[str, np.ndarray], dict[str, int]]:
    """The layers of the scene, and what making them took."""
    counts = {"rays": 0, "responses": 0, "lobes": 0, "steps": 0, "triangles": 0}
    response, evaluate = direct.response, direct.evaluate

    def counted(materials, lit, *rest):
        counts["responses"] += len(lit.index)
        return response(materials, lit, *rest)

    def counted_lobes(lobes, given, *rest):
        counts["lobes"] += len(lobes) * len(given["n"])
        return evaluate(lobes, given, *rest)

    loaded = load(path, skip.overrides)
    run, outputs = Run(RenderStats()), outputs_of(loaded.scene, layers)
    graph = place_and_cull(build(loaded.scene, loaded), outputs, run)
    plan = schedule(graph, outputs, graph.views[0])
    with patch.object(direct, "response", counted), patch.object(direct, "evaluate", counted_lobes):
        shared = run_once(plan, run)
        parts = list(bands(plan, shared, run))
    counts["rays"] = sum(run.stats.rays.values())
    counts["steps"] = len(plan.once) + len(plan.tile)
    counts["triangles"] = shared["geometry"].triangle_count
    return {name: np.concatenate([part.layers[name] for part in parts]) for name in parts[0].layers}, counts


def compared(width: int, each: Callable[[Skip], bool] = yes) -> Iterator[tuple[str, dict, dict, bool]]:
    """Per skip: its name, counts with it and without, and whether the pictures agree in every value."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "scene.yaml")
        for skip in filter(each, SKIPS):
            path.write_text(SCENE.replace("WIDTH", str(width)).replace("lights:", f"{skip.objects}lights:"))
            on, few = render(path, skip, skip.layers)
            with ExitStack() as turned_off:
                for owner, name, other in skip.off:
                    put = patch.object(owner, name, other)
                    turned_off.enter_context(put)
                off, many = render(path, skip, skip.layers_off or skip.layers)
            same = all(np.array_equal(on[name], off[name]) for name in skip.layers)
            yield skip.name, few, many, same


def main() -> None:
    width = int(sys.argv[1]) if len(sys.argv) > 1 else 128
    names = ("rays", "responses", "lobes", "steps", "triangles")
    print(f"{'skip':34}" + "".join(f"{f'{n} with':>16}{'without':>12}" for n in names) + "  same")
    for name, few, many, same in compared(width):
        print(f"{name:34}" + "".join(f"{few[n]:>16,}{many[n]:>12,}" for n in names) + f"  {same}")


if __name__ == "__main__":
    main()
