"""Single pixels have the values that they have in the picture."""

from __future__ import annotations

import numpy as np

from illumcli.render_graph.execute import Run, at_pixels, run_once
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
film: {width: 24, height: 18, samples: 4}
ambient: 1
obscurance: {samples: 8}
objects: [{mesh: {shape: torus}}, {mesh: {shape: disc, radius: 4}, shading: constant}]
lights: [{light: point, position: [3, 4, 5], intensity: 30}]
"""


def test_scattered_pixels_are_those_of_the_picture(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    loaded = load(path)
    steps = planned(loaded, ["beauty", "obscurance", "depth"])
    shared, run = run_once(steps, Run()), Run(threads=2)
    whole = layers_of(steps, run, shared=shared)
    x, y = np.array([23, 0, 11, 12, 3]), np.array([0, 17, 9, 9, 4])
    some = at_pixels(steps, shared, run, x, y)
    for name in ("beauty", "obscurance", "depth"):
        np.testing.assert_array_equal(some[name], whole[name][y, x])
    assert some["beauty"].any()
