"""Two images, layer by layer."""

from __future__ import annotations

import json
import math

import numpy as np
import OpenImageIO as oiio
import pytest

from illumcli.cli.compare import comparison_table
from illumcli.commands.compare import compare_images
from illumcli.commands.compare_limits import LIMITS, refuse_beyond_limits
from illumcli.errors import InputError, ThresholdError
from illumcli.film.channels import channel_types
from illumcli.images.reader import read_image, read_metadata
from illumcli.images.writer import ImageWriter

NAMES = ("R", "G", "B", "A", "Z", "key.R", "key.G", "key.B")


def write(path, pixels, names):
    height, width, _ = pixels.shape
    types = channel_types(names, "float")
    if path.suffix == ".png":
        types, pixels = dict.fromkeys(names, "uint8"), (pixels * 255).astype(np.uint8)
    with ImageWriter(path, width, height, types) as writer:
        writer.write_band(0, pixels)
    return path


@pytest.fixture
def pair(tmp_path):
    """A picture, and one whose red is 0.5 more at x 3, y 2 and whose depth is 2 more at x 1, y 5."""
    a = np.random.default_rng(5).random((12, 10, len(NAMES))).astype(np.float32)
    a[2, 3, 0], a[5, 1, 4] = 0.25, 1.0
    b = a.copy()
    b[2, 3, 0] += 0.5
    b[5, 1, 4] += 2
    return write(tmp_path / "a.exr", a, NAMES), write(tmp_path / "b.exr", b, NAMES)


def test_each_layer_is_measured_by_itself(pair):
    found = {layer.name: layer for layer in compare_images(*pair).layers}
    assert list(found) == ["beauty", "Z", "key"]
    beauty, depth, key = found.values()
    assert beauty.difference.rmse == pytest.approx(math.sqrt(0.25 / 480))
    assert beauty.place == (3, 2, "R")
    assert beauty.difference.peak < 1  # the reference's own
    assert 0 < beauty.flip < 0.2
    assert depth.difference.mae == pytest.approx(2 / 120)
    assert depth.place == (1, 5, "Z")
    assert depth.flip is None
    assert key.difference.psnr == math.inf
    assert key.flip == 0


def test_layers_are_compared_in_the_order_asked_for(pair):
    assert [layer.name for layer in compare_images(*pair, names=("Z", "beauty")).layers] == ["Z", "beauty"]


def test_flip_is_left_out_when_not_wanted(pair):
    assert all(layer.flip is None for layer in compare_images(*pair, flips=False).layers)


def test_channels_of_one_file_alone_are_reported(pair, tmp_path):
    a, _ = pair
    small = write(tmp_path / "small.exr", np.ones((12, 10, 4), np.float32), ("R", "G", "B", "uv.U"))
    found = compare_images(a, small)
    assert found.only_in_reference == ("A", "Z", "key.R", "key.G", "key.B")
    assert found.only_in_test == ("uv.U",)
    assert [layer.channels for layer in found.layers] == [("R", "G", "B")]
    assert f"only in {a}: A, Z, key.R, key.G, key.B" in comparison_table(found)
    assert f"only in {small}: uv.U" in comparison_table(found)


def test_table_names_measures_and_place(pair):
    titles, beauty, depth, _ = comparison_table(compare_images(*pair, flips=False)).split("\n")
    assert titles.split()[:3] == ["layer", "channels", "RMSE"]
    assert beauty.startswith("beauty  R G B A   0.02282")
    assert "0.5      3, 2 R   0" in beauty
    assert "2        1, 5 Z   0" in depth


def test_data_is_valid_json_without_infinities(pair):
    data = json.loads(json.dumps(compare_images(*pair).as_data(), allow_nan=False))
    assert data["layers"][0]["at"] == {"x": 3, "y": 2, "channel": "R"}
    assert data["layers"][2]["psnr"] is None


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"max_rmse": 0.02}, "beauty: RMSE is 0.0228218, above 0.02"),
        ({"max_mae": 0.001}, "beauty: MAE is"),
        ({"max_relative": 1e-4}, "beauty: relative MSE is"),
        ({"min_psnr": 90}, "beauty: PSNR is"),
        ({"max_flip": 1e-6}, "beauty: FLIP is"),
        ({"max_difference": 0.4}, "beauty: largest difference is 0.5, above 0.4"),
    ],
)
def test_each_limit_is_kept_watch_over(pair, limits, words):
    found = compare_images(*pair)
    with pytest.raises(ThresholdError, match=words) as caught:
        refuse_beyond_limits(found, limits)
    assert caught.value.exit_code == 3
    generous = {name: -1e3 if name == "min_psnr" else 1e3 for name in limits}
    refuse_beyond_limits(found, generous)


def test_all_limits_passed_over_are_told_at_once(pair):
    with pytest.raises(ThresholdError) as caught:
        refuse_beyond_limits(
            compare_images(*pair), {name: 1e6 if name == "min_psnr" else -1 for name in LIMITS}
        )
    told = str(caught.value)
    assert all(f"beauty: {measure} is" in told for measure in LIMITS.values())
    assert "Z: largest difference is 2" in told


def test_a_measure_at_its_limit_passes(pair):
    refuse_beyond_limits(compare_images(*pair, names=("Z",)), {"max_difference": 2})


def test_no_limit_is_never_exceeded(pair):
    refuse_beyond_limits(compare_images(*pair), {})


def test_limit_on_flip_needs_colour(pair):
    with pytest.raises(InputError, match="no layer compared has R, G and B"):
        refuse_beyond_limits(compare_images(*pair, names=("Z",)), {"max_flip": 0.1})


def test_nan_is_counted_and_beyond_any_limit(pair, tmp_path):
    a, b = pair
    buffer = oiio.ImageBuf(str(b))
    buffer.setpixel(4, 7, [float("nan")] * 8)
    assert buffer.write(str(tmp_path / "nan.exr"))
    found = compare_images(a, tmp_path / "nan.exr")
    assert [layer.difference.not_finite for layer in found.layers] == [4, 1, 3]
    assert [layer.flip for layer in found.layers] == [None] * 3
    assert found.layers[0].difference.rmse == pytest.approx(math.sqrt(0.25 / 476))
    for limit in ({"max_rmse": 1e6}, {"max_flip": 1.0}):
        with pytest.raises(ThresholdError, match="beauty: 4 values are NaN or infinite"):
            refuse_beyond_limits(found, limit)


def test_unreadable_files_are_told_together(tmp_path):
    (tmp_path / "bad.exr").write_text("no image")
    with pytest.raises(InputError) as caught:
        compare_images(tmp_path / "none.exr", tmp_path / "bad.exr")
    assert len(caught.value.problems) == 2


def test_files_of_other_size_or_kind_are_refused(pair, tmp_path):
    a, _ = pair
    wide = write(tmp_path / "wide.exr", np.ones((12, 20, 3), np.float32), "RGB")
    with pytest.raises(InputError, match=r"wide.exr: is 20 x 12, but .*a.exr is 10 x 12"):
        compare_images(a, wide)
    display = write(tmp_path / "a.png", np.ones((12, 10, 3), np.float32), "RGB")
    with pytest.raises(InputError, match=r"a.png: holds display values, but .*a.exr linear light"):
        compare_images(a, display)


def test_unknown_layers_are_refused_with_a_suggestion(pair):
    with pytest.raises(InputError, match="no layer 'keys' in both; did you mean 'key'"):
        compare_images(*pair, names=("keys",))


def test_files_without_a_common_channel_are_refused(pair, tmp_path):
    uv = write(tmp_path / "uv.exr", np.ones((12, 10, 1), np.float32), ("uv.U",))
    with pytest.raises(InputError, match="no channel in common"):
        compare_images(pair[0], uv)


def test_display_values_are_compared_as_stored(tmp_path):
    a = write(tmp_path / "a.png", np.full((4, 5, 3), 0.2, np.float32), "RGB")
    b = write(tmp_path / "b.png", np.full((4, 5, 3), 0.6, np.float32), "RGB")
    layer = compare_images(a, b).layers[0]
    assert layer.difference.rmse == pytest.approx(0.4)
    assert layer.difference.psnr == pytest.approx(-20 * math.log10(0.4), abs=1e-5)


def test_heat_shows_the_largest_difference_over_channels(pair, tmp_path):
    found = compare_images(*pair, heat_file=tmp_path / "heat.png")
    image = read_image(tmp_path / "heat.png")
    assert found.heat_scale == 0.5
    brightest = np.unravel_index(image.channels["R"].argmax(), (12, 10))
    assert brightest == (2, 3)
    assert sum(channel.sum() for channel in image.channels.values()) == pytest.approx((255 + 250 + 205) / 255)
    assert read_metadata(tmp_path / "heat.png")["illum:heat_scale"] == "0.5"


def test_heat_of_equal_images_is_black(pair, tmp_path):
    compare_images(pair[0], pair[0], heat_file=tmp_path / "heat.png")
    assert all(channel.max() == 0 for channel in read_image(tmp_path / "heat.png").channels.values())


def test_heat_is_a_png(pair, tmp_path):
    with pytest.raises(InputError, match=r"heat\.exr: a heat picture is written as \.png"):
        compare_images(*pair, heat_file=tmp_path / "heat.exr")
