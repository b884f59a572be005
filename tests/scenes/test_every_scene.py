"""What every scene of scenes/ promises to its readers and to the gallery."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.render_graph.execute import Run
from illumcli.scene.load import load
from planned import layers_of, planned

SMALL = ["film.width=48", "film.height=27", "film.samples=1"]


def test_no_file_of_a_scene_is_large(root):
    for path in (root / "scenes").rglob("*"):
        assert path.is_dir() or path.stat().st_size < 100_000, path.name


@pytest.mark.slow
def test_every_scene_has_something_to_see_and_no_odd_pixel(root):
    for path in sorted((root / "scenes").glob("*.yaml")):
        loaded = load(path, SMALL)
        beauty = layers_of(planned(loaded, ["beauty"]), Run(threads=2))["beauty"]
        assert np.isfinite(beauty).all(), path.name
        assert (beauty >= 0).all(), path.name
        assert beauty.max() > 0.1, path.name
        assert np.ptp(beauty) > 0.05 or path.stem == "textbook-halfway", path.name
