"""The data of the BRDF panel are those of `illum brdf`."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from illumcli.brdf import views
from illumcli.brdf.pictures import in_srgb
from illumcli.color import luminance
from illumcli.models.ward import Ward
from illumcli.scene.load import load
from illumcli.viewer.lobes import LobePanel

SCENE = """version: 1
materials:
  satin: {model: ward, alpha_x: 0.1, alpha_y: 0.4}
  turned: {model: ward, alpha_x: 0.4, alpha_y: 0.1}
  wall: {model: lambert, diffuse: {texture: missing.png, factor: 0.5}}
objects:
  - {mesh: {shape: sphere}, name: ball, material: {model: phong, exponent: 7}}
  - {mesh: {shape: sphere}, name: dull, material: satin, override: {specular: 0}}
"""


@pytest.fixture
def ask(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(SCENE)
    loaded, panel = load(path), LobePanel()

    def answer(*of, theta=40, phi=0, **scale):
        return panel.answer(loaded, {"of": of, "theta": theta, "phi": phi, **scale})

    return answer


def points(lobe):
    data = np.frombuffer(base64.b64decode(lobe["points"]), "<f4")
    return data.reshape(lobe["rows"], lobe["columns"], 3)


def pixels(picture):
    data = np.frombuffer(base64.b64decode(picture["pixels"]), np.uint8)
    return data.reshape(picture["height"], picture["width"], 4)


@pytest.mark.parametrize("cosine", [False, True])
def test_slices_and_pictures_are_those_of_the_plots(ask, cosine):
    answer = ask({"material": "satin"}, cosine=cosine)
    (found,) = answer["lobes"]
    model = Ward(alpha_x=0.1, alpha_y=0.4)
    angles, values = views.polar_slice(model, 40, cosine)
    np.testing.assert_allclose(found["slice"]["angles"], angles, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(found["slice"]["values"], luminance(values), rtol=1e-4)
    sphere = np.round(in_srgb(views.lit_sphere(model, found["sphere"]["width"])) * 255)
    np.testing.assert_array_equal(pixels(found["sphere"]), sphere)
    assert found["title"] == "Ward"
    assert answer["quantity"] == ("response, cosine included" if cosine else "BRDF [1/sr]")


def test_radii_are_shares_of_one_scale_for_all(ask):
    one, two = ask({"material": "satin"}), ask({"material": "satin"}, {"model": "lambert"})
    assert one["top"] == two["top"]
    lambert = two["lobes"][1]
    np.testing.assert_allclose(np.array(lambert["slice"]["radius"]), 0.8 / np.pi / two["top"], rtol=1e-4)
    np.testing.assert_allclose(
        np.linalg.norm(points(lambert["lobe"]), axis=-1), 0.8 / np.pi / two["top"], rtol=1e-4
    )
    assert max(ask({"material": "satin"}, log=True)["lobes"][0]["slice"]["radius"]) <= 1


def test_phi_turns_the_light_and_not_the_grain(ask):
    answer = ask({"material": "satin"}, phi=30)
    surface = points(answer["lobes"][0]["lobe"]).reshape(-1, 3).astype(float)
    lengths = np.linalg.norm(surface, axis=1)
    v = surface / lengths[:, None]
    n, l, t = (np.broadcast_to(each, v.shape) for each in ((0, 0, 1.0), answer["incident"], (1.0, 0, 0)))
    values = luminance(views.values(Ward(alpha_x=0.1, alpha_y=0.4), n, l, v, t, times_cos=False))
    inside = (lengths < 1) & (v[:, 2] > 0.05)
    np.testing.assert_allclose(lengths[inside] * answer["top"], values[inside], rtol=1e-3)
    np.testing.assert_allclose(answer["incident"][:2], [-0.55667, -0.32139], atol=1e-5)


def test_textures_are_taken_as_white(ask):
    (found,) = ask({"material": "wall"})["lobes"]
    np.testing.assert_allclose(found["slice"]["values"], 0.5 / np.pi, rtol=1e-4)


def test_objects_have_their_own_material(ask):
    ball, dull = ask({"object": "ball"}, {"object": "dull"})["lobes"]
    assert ball["title"] == "Phong"
    assert np.ptp(dull["slice"]["values"]) == 0


def test_what_cannot_be_shown_says_why_beside_the_others(ask):
    answer = ask({"material": "sattin"}, {"model": "merl"}, {"model": "lambrt"}, {}, {"model": "lambert"})
    problems = [each.get("problem") for each in answer["lobes"]]
    assert problems == [
        "no material 'sattin'; did you mean 'satin'?",
        "merl needs file, which only its author knows; write it into the scene file",
        "no model 'lambrt'; did you mean 'lambert'?",
        "a BRDF is that of a material, an object or a model; name one",
        None,
    ]
