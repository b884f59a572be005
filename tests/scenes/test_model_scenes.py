"""What the scenes of the models claim to show."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.render_graph.execute import Run
from illumcli.scene.load import load
from planned import layers_of, planned


@pytest.fixture
def picture(root):
    """(H, W, 3) linear beauty of a scene's camera, with its layers' alpha and object numbers."""

    def render(name, camera=0, overrides=()):
        loaded = load(
            root / "scenes" / f"{name}.yaml", ["film.samples=1", "film.background=null", *overrides]
        )
        return layers_of(planned(loaded, ["beauty", "object_id"], number=camera), Run(threads=2))

    return render


def test_the_full_moon_is_a_ball_or_a_disc(picture):
    layers = picture("moon", overrides=["film.width=500", "film.height=100"])
    fall = []
    for moon in range(1, 6):
        on_moon = layers["object_id"][..., 0] == moon
        light = layers["beauty"][..., 0][on_moon]
        y, x = np.nonzero(on_moon)
        away = np.hypot(x - x.mean(), y - y.mean()) / np.sqrt(on_moon.sum() / np.pi)
        fall.append(light[(away > 0.93) & (away < 0.97)].mean() / light[away < 0.3].mean())
    lambert, rough, rugged, limb, dust = fall
    assert lambert == pytest.approx(np.sqrt(1 - 0.95**2), abs=0.03)
    assert lambert + 0.25 < rough < rugged < 1
    assert limb == pytest.approx(1, abs=1e-4)
    assert dust == pytest.approx(1, abs=1e-4)


def test_copper_turns_to_the_colour_of_its_light_at_grazing(picture):
    layers = picture("copper", overrides=["film.width=1440", "film.height=360"])
    redness = []
    for ball in range(1, 5):
        light = layers["beauty"][layers["object_id"][..., 0] == ball]
        x = np.nonzero(layers["object_id"][..., 0] == ball)[1]
        front, rim = light[x < x.mean()], light[x > x.max() - 6]
        redness.append([part[:, 0].sum() / part[:, 2].sum() for part in (front, rim)])
    constant, *turning = redness
    assert constant[0] == pytest.approx(constant[1], rel=1e-4) == pytest.approx(0.95 / 0.54, rel=1e-4)
    for front, rim in turning:
        assert front > 1.65
        assert 1 < rim < 0.87 * front


def test_the_gallery_goes_from_dull_to_mirror(picture):
    layers = picture("gallery", overrides=["film.width=588", "film.height=264"])
    strauss = [layers["beauty"][layers["object_id"][..., 0] == number] for number in range(11, 16)]
    middle = [np.median(light[:, 0]) for light in strauss]
    assert middle == sorted(middle, reverse=True)
    contrast = [np.quantile(light[:, 0], 0.99) / np.median(light[:, 0]) for light in strauss]
    assert contrast[1:] == sorted(contrast[1:])
    assert contrast[-1] > 20 * contrast[0]


def test_joints_are_dull_between_shining_tiles(picture):
    own = ["film.width=480", "film.height=270", "obscurance=null", "materials.tiles.color.filter=nearest"]
    shining = picture("textures", overrides=[*own, "materials.tiles.smoothness.filter=nearest"])
    plain = picture("textures", overrides=[*own, "materials.tiles.smoothness=0"])["beauty"]
    ball = shining["object_id"][..., 0] == 2
    gain = (shining["beauty"] - plain)[ball].max(axis=1)
    joint = plain[ball].min(axis=1) / plain[ball].max(axis=1) > 0.7  # they alone are grey
    assert gain[~joint].max() > 0.1
    assert np.abs(gain[joint]).max() < 0.02


def test_the_gallery_hangs_on_a_real_mesh(picture, real_mesh, monkeypatch):
    path = real_mesh("spot.obj")
    monkeypatch.setenv("ILLUM_ALLOW", str(path.parent))
    layers = picture(
        "gallery", overrides=[f"meshes.pot={{file: {path}}}", "film.width=490", "film.height=220"]
    )
    assert set(np.unique(layers["object_id"])) >= set(range(61))
    assert np.isfinite(layers["beauty"]).all()
    for number in range(1, 61):
        assert layers["beauty"][layers["object_id"][..., 0] == number].max() > 0.05
