"""The audit of reconstructed pictures: right on average, the same for any tiles, never 0 by chance."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.accuracy.audit import Audit, AuditedError, audited_layer, drawn, pixel_chances
from illumcli.accuracy.sampled_blocks import SampledBlocks
from illumcli.files.seal import is_sealed
from illumcli.film.tiles import tiles
from illumcli.images.png import read_texts
from illumcli.images.reader import read_metadata
from illumcli.render_graph.execute import Run, bands, run_once
from illumcli.scene.load import load
from planned import layers_of, planned

SCENE = """
version: 1
camera: {position: [1.5, 1.6, 3], target: [0, 0.4, 0], fov: 40}
film: {width: 96, height: 72, samples: 1}
ambient: [0.3, 0.4, 0.5]
obscurance: {samples: 2, reconstruct: true}
meshes: {ball: {shape: sphere, radius: 0.5, segments: 20, rings: 10}}
objects:
  - {mesh: {shape: plane, size: [6, 6]}}
  - {mesh: ball, transform: {translate: [0, 0.5, 0]}}
  - {mesh: ball, transform: {translate: [1, 0.5, 0]}}
lights: [{light: directional, direction: [1, -2, -1]}]
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(SCENE)
    return path


def audited(path, *overrides, only="beauty", threads=1, side=None):
    """The picture of a layer, and its audit."""
    steps = planned(load(path, overrides), [only])
    shared = run_once(steps, Run(threads=threads))
    layer = audited_layer(steps)
    assert layer is not None
    audit = Audit.of(steps, layer, steps.graph.scene.seed)

    def develop(tile, layers):
        audit.take(tile, layers)
        return layers

    made = list(bands(steps, shared, Run(threads=threads), side=side, develop=develop))
    picture = np.concatenate([band.layers[only] for band in made]).astype(np.float64)
    return picture, audit.error(shared, Run(threads=threads))


def test_pixels_are_drawn_by_the_contrast_around_them():
    picture = np.zeros((40, 50, 1), np.float32)
    picture[20, 30] = 1
    chances = pixel_chances(picture)
    assert chances.sum() == pytest.approx(1)
    near = chances.reshape(40, 50)[19:22, 29:32]
    assert (near == near[0, 0]).all()
    assert near.sum() == pytest.approx(2 / 3, rel=0.01)
    assert (pixel_chances(picture * 0) == 1 / 2000).all()


def test_weights_make_the_mean_unbiased():
    """Also of what is nearly all at one pixel."""
    random = np.random.default_rng(3)
    values = random.random(2000)
    values[1030] = 4000
    picture = values.reshape(40, 50, 1).astype(np.float32)
    chances = pixel_chances(picture)
    means, errors = [], []
    for _ in range(400):
        pixel = drawn(chances, 300, random.random())
        stated = AuditedError.of_products("beauty", values[pixel], 1 / (chances[pixel] * 2000 * 300))
        means.append(stated.rmse**2)
        errors.append(2 * stated.standard_error * stated.rmse)
    error = np.std(means) / np.sqrt(len(means))
    assert abs(np.mean(means) - values.mean()) < 4 * error
    assert np.std(means) < 1.1 * np.mean(errors)


def test_what_is_lost_in_its_own_error_is_not_stated_as_0():
    share = np.full(5, 0.2)
    lost = AuditedError.of_products("beauty", np.array([-1.0, 0.5, 0.2, -0.1, 0.1]) * 1e-6, share)
    assert lost.low == 0
    assert 0 < lost.rmse <= lost.high
    assert AuditedError.of_products("beauty", np.zeros(5), share).rmse == 0
    uneven = AuditedError.of_products("beauty", np.tile([0, 2e-6], 50), np.full(100, 0.01))
    assert uneven.standard_error == pytest.approx(1e-6 / np.sqrt(99) / (2 * uneven.rmse))
    assert AuditedError.of_products("beauty", np.full(5, 4e-6), share).rmse == pytest.approx(0.002)


@pytest.mark.parametrize(("samples", "only"), [(1, "obscurance"), (3, "beauty")])
def test_the_stated_error_is_the_true_one(path, samples, only):
    """Against pictures of many rays, antialiased far better; over some seeds, by the stated errors."""
    finer = 1 if samples == 1 else 16
    off = ["obscurance={samples: 256, sampler: owen}" if samples == 1 else "obscurance={samples: 32}"]
    truth = []
    for seed in (91, 92):
        steps = planned(load(path, [f"film.samples={finer}", *off, f"seed={seed}"]), [only])
        truth.append(layers_of(steps, Run(threads=2))[only].astype(np.float64))
    ratios, spreads = [], []
    for seed in range(4):
        picture, stated = audited(path, f"film.samples={samples}", f"seed={seed}", only=only)
        true = np.sqrt(np.mean((picture - truth[0]) * (picture - truth[1])))
        ratios.append(stated.rmse / true)
        spreads.append(stated.standard_error / stated.rmse)
    error = np.sqrt(np.square(spreads).sum()) / len(spreads)
    assert abs(np.mean(ratios) - 1) < 3.5 * error + 0.02, ratios


def test_tiles_and_threads_do_not_change_the_stated_error(path):
    picture, stated = audited(path)
    again, other = audited(path, threads=2, side=24)
    np.testing.assert_array_equal(picture, again)
    assert stated == other


@pytest.mark.parametrize("samples", [1, 3])
def test_pixels_that_are_drawn_again_get_other_rays(path, samples):
    """A picture of one pixel is audited by many estimates of it, whose mean has an error."""
    overrides = ["film.width=1", "film.height=1", "camera.target=[0.5, 0, 0.1]", f"film.samples={samples}"]
    for seed in range(4):
        _, stated = audited(path, *overrides, f"seed={seed}")
        assert 0 < stated.low < stated.rmse < stated.high


def test_large_pictures_are_audited_in_blocks(path, monkeypatch):
    """The film has columns and rows beyond whole blocks."""
    film = ("film.width=100", "film.height=77")
    _, whole = audited(path, *film)
    monkeypatch.setattr("illumcli.accuracy.sampled_blocks.MOST_PIXELS", 4000)
    _, sampled = audited(path, *film)
    _, other = audited(path, *film, threads=2, side=24)
    assert sampled == other
    assert sampled != whole
    assert sampled.rmse == pytest.approx(whole.rmse, rel=0.25)


def test_blocks_hold_the_pixels_of_their_places(path, monkeypatch):
    monkeypatch.setattr("illumcli.accuracy.sampled_blocks.MOST_PIXELS", 2000)
    view = planned(load(path, ("film.width=61", "film.height=83"))).view
    blocks = SampledBlocks.of(view, 1, 3)
    numbers = np.arange(61 * 83, dtype=np.float32).reshape(83, 61, 1)
    for row in tiles(61, 83, 13, 1):
        for tile in row:
            rows, columns = slice(tile.y, tile.y + tile.height), slice(tile.x, tile.x + tile.width)
            blocks.take(tile, numbers[rows, columns])
    index = np.flatnonzero(blocks.is_inside)
    x, y = blocks.pixels(index)
    assert 1000 < len(index) < 3000
    np.testing.assert_array_equal(blocks.values.ravel()[index], y * 61 + x)


def test_the_report_and_the_terminal_state_it(path, illum, tmp_path):
    done = illum("render", path, "-o", "out.exr", "--report", "report.json", "-v", cwd=tmp_path)
    report = json.loads((tmp_path / "report.json").read_text())
    stated = report["audited_error"]["main"]
    assert stated["layer"] == "beauty"
    assert 0 < stated["low"] < stated["rmse"] < stated["high"]
    assert report["rays"]["audit"] == stated["rays"]
    interval = f"(95 %: {stated['low']:.3g} to {stated['high']:.3g})"
    assert f"RMSE of beauty of main: {stated['rmse']:.3g} {interval}" in done.stderr


@pytest.mark.parametrize("target", [(), ("--target-error", "0.03")])
def test_the_files_that_hold_the_layer_state_it(path, illum, tmp_path, target):
    values = ("outputs.files=['{layer}.png', all.exr]", "outputs.layers=[beauty, depth]")
    words = [*target, *(word for value in values for word in ("-D", value)), "--report", "report.json"]
    illum("render", path, *words, cwd=tmp_path)
    stated = json.loads((tmp_path / "report.json").read_text())["audited_error"]["main"]
    interval = f"(95 %: {stated['low']:.3g} to {stated['high']:.3g})"
    text = f"RMSE of beauty: {stated['rmse']:.3g} {interval}"
    found = {name: read_texts(tmp_path / name) for name in ("beauty.png", "depth.png")}
    found["all.exr"] = read_metadata(tmp_path / "all.exr")
    texts = {name: data.get("illum:audited_error", "").rstrip() for name, data in found.items()}
    assert texts == {"beauty.png": text, "depth.png": "", "all.exr": text}
    assert all(is_sealed(tmp_path / name) for name in found)


@pytest.mark.parametrize(
    "overrides", [("obscurance.reconstruct=false",), ("obscurance=null",), ("outputs.layers=[depth]",)]
)
def test_nothing_is_stated_where_nothing_is_reconstructed(path, illum, tmp_path, overrides):
    words = [word for override in overrides for word in ("-D", override)]
    illum("render", path, "-o", "out.exr", "--report", "report.json", *words, cwd=tmp_path)
    assert json.loads((tmp_path / "report.json").read_text())["audited_error"] == {}
