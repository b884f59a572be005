"""Pictures in bands of rows: the same bytes as at once."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from illumcli.commands.bands import LEAST, ROWS, band_counts, rows_of_bands
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.commands.unit import Worker
from illumcli.images.picture_bands import join_bands
from ring import RING

LAYERS = "outputs.layers=[beauty, position, object_id, obscurance]"
FILES = "outputs.files=['{scene}.exr', '{scene}.{layer}.png']"


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.yaml").write_text(RING.format(samples=4, ambient=1))
    return tmp_path / "s.yaml"


@pytest.mark.parametrize(
    "overrides", [(), ("film.adaptive=true",), ("film.samples=1", "film.background=[0.1, 0.2, 0.3]")]
)
def test_joined_bands_are_the_bytes_of_the_picture(scene, tmp_path, overrides):
    job = RenderJob(scene, RenderOptions((LAYERS, FILES, *overrides), cache=False))
    pictures, whole = render_scene(job)
    expected = {path: path.read_bytes() for path in pictures}
    parts = [render_scene(replace(job, rows=rows)) for rows in pairwise((0, 8, 24, 36))]
    for number, path in enumerate(pictures):
        path.unlink()
        join_bands([paths[number] for paths, _ in parts], path)
        assert path.read_bytes() == expected[path]
    assert sum(report.rays.get("obscurance", 0) for _, report in parts) == whole.rays["obscurance"]


def test_large_pictures_are_cut_and_small_ones_stay_whole():
    large = 10 * LEAST
    assert band_counts([large], 1) == [1]
    assert band_counts([large], 2) == [8]
    assert band_counts([LEAST - 1], 2) == [1]
    assert band_counts([large] * 10, 2) == [1] * 10
    assert band_counts([large, LEAST, large], 3) == [6, 1, 6]


def test_bands_have_whole_blocks_and_end_with_the_picture(scene):
    (view,) = Worker().prepare(RenderJob(scene)).graph.views
    for height, count in ((36, 4), (640, 4), (1000, 3), (65, 9)):
        rows = rows_of_bands(replace(view, height=height), count)
        assert len(rows) <= count
        assert [first for first, _ in rows] == [0, *(end for _, end in rows[:-1])]
        assert rows[-1][1] == height
        assert all(first % ROWS == 0 for first, _ in rows)
