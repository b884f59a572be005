"""PNGs of layers other than light: plain numbers, no transfer curve, values that can be recovered."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.images.reader import read_image, read_metadata

SCENE = """version: 1
film: {width: 40, height: 30, samples: 1, exposure: 1.5}
camera: {position: [0, 2, 7], target: [0, 0.4, 0], fov: 40}
ambient: 0.4
obscurance: {samples: 16}
objects:
  - {mesh: {shape: sphere}, transform: {translate: [0.3, 1, 0]}}
  - {mesh: {shape: plane, size: [3, 6]}}
lights: [{light: point, name: key, position: [3, 4, 2], intensity: 20}]
outputs: {colour: float}
"""
NAMES = ("depth", "position", "normal", "uv", "obscurance", "shadow.key", "alpha", "object_id", "error")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Layer -> (values, bytes / 255, metadata)."""
    folder = tmp_path_factory.mktemp("data")
    (folder / "s.yaml").write_text(SCENE)
    only = [*NAMES, "key"]
    render_scene(
        RenderJob(folder / "s.yaml", RenderOptions(pattern=str(folder / "all.exr"), only=only, cache=False))
    )
    render_scene(
        RenderJob(
            folder / "s.yaml", RenderOptions(pattern=str(folder / "{layer}.png"), only=only, cache=False)
        )
    )
    exact = read_image(folder / "all.exr").channels
    names = {"depth": "Z", "alpha": "A", "uv": "uv.UV", "position": "P.XYZ", "normal": "N.XYZ"}

    def values(layer):
        group, _, parts = names.get(layer, f"{layer.replace('object_id', 'objectId')}.Y").rpartition(".")
        return np.stack([exact[f"{group}.{part}" if group else part] for part in parts], axis=-1)

    def shown(layer):
        image = read_image(folder / f"{layer}.png").channels
        return np.stack([image[name] for name in image], axis=-1)

    found = {name: (values(name), shown(name), folder / f"{name}.png") for name in NAMES}
    return found | {"key": (None, None, folder / "key.png")}


@pytest.mark.parametrize("name", NAMES)
def test_no_curve_is_named(pictures, name):
    data = pictures[name][2].read_bytes()
    assert b"sRGB" not in data[:100]
    assert b"gAMA" not in data[:100]
    assert "illum:values" in read_metadata(pictures[name][2])


def test_light_stays_srgb(pictures):
    data = pictures["key"][2].read_bytes()
    assert b"sRGB" in data[:100]
    assert "illum:values" not in read_metadata(pictures["key"][2])


@pytest.mark.parametrize("name", ["obscurance", "shadow.key", "alpha", "error"])
def test_shares_are_bytes_whatever_the_exposure(pictures, name):
    values, shown, _ = pictures[name]
    np.testing.assert_array_equal(np.rint(shown * 255), np.rint(np.clip(values, 0, 1) * 255))
    assert values.any()


def test_depth_is_got_back_from_the_file_alone(pictures):
    depth, shown, path = pictures["depth"]
    scale = float(read_metadata(path)["illum:scale"])
    seen = shown > 0
    np.testing.assert_array_equal(seen, depth > 0)
    half = 0.5 / 255 + 1e-6  # of a step
    assert (depth[seen] >= scale * (1 / (shown[seen] + half) - 1)).all()
    assert (depth[seen] <= scale * (1 / (shown[seen] - half) - 1)).all()


def test_positions_and_normals_are_got_back(pictures):
    position, shown, path = pictures["position"]
    said = read_metadata(path)
    scale, centre = float(said["illum:scale"]), np.array(said["illum:centre"].split(), float)
    seen = pictures["depth"][0][..., 0] > 0
    found = centre + scale * (2 * shown[seen] - 1)
    np.testing.assert_allclose(found, position[seen], atol=scale * 1.01 / 255)
    normal, shown, _ = pictures["normal"]
    np.testing.assert_allclose(2 * shown[seen] - 1, normal[seen], atol=1.01 / 255)


def test_nothing_seen_is_black_however_far_things_are(tmp_path):
    (tmp_path / "far.yaml").write_text(
        "version: 1\nfilm: {width: 4, height: 4, samples: 1}\n"
        "camera: {position: [0, 0, 5], target: [0, 0, 4.9]}\n"
        "objects: [{mesh: {shape: plane, size: [900, 900]}, "
        "transform: {rotate: [90, 0, 0], translate: [0, 0, -2000]}}]\n"
    )
    render_scene(
        RenderJob(
            tmp_path / "far.yaml", RenderOptions(pattern=str(tmp_path / "z.png"), only=["depth"], cache=False)
        )
    )
    shown = read_image(tmp_path / "z.png").channels["Y"]
    assert sorted(np.unique(shown * 255).round().tolist()) == [0, 1]


def test_ids_beyond_single_precision_stay_exact_the_whole_way(tmp_path, monkeypatch):
    """From the samples through tiles, pixels and the file: neighbours beyond 2^24 stay apart."""
    from illumcli.render_graph import build

    def triangle_id(hits):
        return (hits.triangle + 2**24 + 1).astype(np.uint32)

    (tmp_path / "s.yaml").write_text(SCENE)
    names = {"half": ["triangle_id", "beauty"], "float": ["depth", "triangle_id"]}
    render_scene(
        RenderJob(
            tmp_path / "s.yaml",
            RenderOptions(pattern=str(tmp_path / "plain.exr"), only=["triangle_id"], cache=False),
        )
    )
    plain = read_image(tmp_path / "plain.exr").channels["triangleId.Y"]
    monkeypatch.setattr(build, "triangle_id", triangle_id)
    for colour, only in names.items():
        path = tmp_path / f"{colour}.exr"
        render_scene(
            RenderJob(
                tmp_path / "s.yaml", RenderOptions([f"outputs.colour={colour}"], str(path), only, cache=False)
            )
        )
        found = read_image(path).channels["triangleId.Y"]
        assert found.dtype == np.uint32
        np.testing.assert_array_equal(found, np.where(plain > 0, plain + 2**24, 0))
    assert len(np.unique(plain)) > 100
