"""Shading rates: normals of obscurance and of shading."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.film.tiles import Tile
from illumcli.render_graph.build import READ
from illumcli.render_graph.execute import Run, run_once
from illumcli.scene.load import load
from illumcli.shading.rates import obscurance_normals
from planned import planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 24, height: 16, samples: 2}
ambient: 1
obscurance: {samples: 1}
objects:
  - {mesh: {shape: plane, size: [6, 6]}, shading: FIRST, material: {model: lambert}}
  - {mesh: {shape: sphere, segments: 12, rings: 6}, shading: SECOND, material: {model: lambert}}
"""


@pytest.mark.parametrize("rates", [("phong", "phong"), ("quadratic", "phong"), ("gouraud", "phong")])
def test_hemispheres_stand_about_the_normals_that_are_shaded_with(tmp_path, rates):
    """Interpolated once where every object is shaded at the samples."""
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("FIRST", rates[0]).replace("SECOND", rates[1]))
    plan = planned(load(path), ["ambient"])
    buffers = {**run_once(plan, Run()), "view": plan.view, "tile": Tile(0, 0, 24, 16), READ: None}
    for node in plan.tile:
        buffers[node.output] = node.run(buffers)
    normals = buffers["obscurance_normals"]
    assert normals.tobytes() == obscurance_normals(rates, buffers["shading_context"]).tobytes()
    assert (normals is buffers["points"].n) == ("gouraud" not in rates)
    assert np.ptp(normals, axis=0).max() > 0.5
