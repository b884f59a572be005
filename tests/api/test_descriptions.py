"""Scenes built from the classes of their parts, as an editor completes them."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest

import illumcli as illum
from illumcli.geometry.shapes.polygons import Polygons
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.lights._attenuation import Polynomial
from illumcli.lights.point import Point
from illumcli.models.cook_torrance import CookTorrance
from illumcli.models.ward import Ward
from illumcli.schema.docs import field_docs
from illumcli.visibility.falloffs.exponential import Exponential

PLAIN = {
    "version": 1,
    "film": {"width": 24, "height": 16, "samples": 2, "adaptive": True},
    "camera": {"position": [0, 1, 4]},
    "ambient": 0.3,
    "obscurance": {"samples": 4, "falloff": {"falloff": "exponential", "tau": 2}},
    "materials": {"metal": {"model": "cook_torrance"}},
    "objects": [
        {"mesh": {"shape": "sphere"}, "material": {"model": "ward", "alpha_x": 0.2}},
        {"mesh": {"shape": "polygons", "vertices": [[-2, 0, 0], [2, 0, 0], [0, 0, -2]], "faces": [[0, 1, 2]]}}
        | {"material": "metal", "transform": {"translate": [0, -1, 0]}},
    ],
    "lights": [
        {"light": "point", "position": [3, 4, 2], "attenuation": {"law": "polynomial", "c1": 0.5}},
    ],
}
BUILT = illum.Scene(
    version=1,
    film=illum.Film(width=24, height=16, samples=2, adaptive=illum.Adaptive()),
    camera=illum.Perspective(position=(0, 1, 4)),
    ambient=illum.Ambient(color=(0.3, 0.3, 0.3)),
    obscurance=illum.Obscurance(samples=4, falloff=Exponential(tau=2)),
    materials={"metal": CookTorrance()},
    objects=[
        illum.Object(mesh=Sphere(), material=Ward(alpha_x=0.2)),
        illum.Object(
            mesh=Polygons(vertices=[(-2, 0, 0), (2, 0, 0), (0, 0, -2)], faces=[(0, 1, 2)]),
            material="metal",
            transform=illum.Transform(translate=(0, -1, 0)),
        ),
    ],
    lights=[Point(position=(3, 4, 2), attenuation=Polynomial(c1=0.5))],
)


def test_a_scene_of_classes_is_that_of_the_mapping():
    pictures = [illum.render(each, cache=False)["beauty"] for each in (BUILT, PLAIN)]
    assert pictures[0].any()
    np.testing.assert_array_equal(*pictures)


def test_classes_are_values_of_mappings_and_overrides():
    mixed = PLAIN | {"film": illum.Film(width=24, height=16), "materials": {"metal": Ward()}}
    rendering = illum.render(mixed, {"materials.metal": CookTorrance(), "film.samples": 2}, cache=False)
    np.testing.assert_array_equal(
        rendering["beauty"], illum.render(PLAIN, {"film.adaptive": None}, cache=False)["beauty"]
    )


@pytest.mark.parametrize("name", [name for name in illum.__all__ if name[0].isupper()])
def test_fields_have_texts(name):
    if name != "IllumError":
        cls = getattr(illum, name)
        assert set(field_docs(cls)) | {"projection", "version"} >= set(cls.model_fields)


USER = """\
import illumcli as illum
from illumcli.lights.spot import Spot
from illumcli.models.phong import Phong

ball = illum.Object(mesh="ball.obj", material=Phong(diffuse=(0.5, 0.4, 0.3), exponent=40))
scene = illum.Scene(
    version=1,
    objects=[ball],
    lights=[Spot(position=(1, 2, 3), target=(0, 0, 0))],
)
reveal_type(scene.film.width)
reveal_type(illum.render(scene, {"seed": 3}, layers="depth")["depth"])
reveal_type(illum.render(scene, frames="0:3"))
reveal_type(illum.sweep(scene, {"seed": [1, 2]})[0])
illum.Film(widht=3)
illum.Film(width="3")
illum.render(scene, layer="depth")
Phong(shininess=3)
illum.bake("m.obj", sampels=3)
"""
TOLD = {
    11: '"int"',
    12: "numpy.ndarray[",
    13: "list[illumcli.api.pictures.Rendering]",
    14: "dict[str, Any]",
    15: 'Unexpected keyword argument "widht" for "Film"',
    16: 'Argument "width" to "Film" has incompatible type "str"; expected "int"',
    17: 'Unexpected keyword argument "layer"',
    18: 'Unexpected keyword argument "shininess" for "Phong"',
    19: 'Unexpected keyword argument "sampels" for "bake"',
}
"""Line -> what a type checker says of it."""


def test_a_type_checker_knows_the_interface(root, tmp_path):
    """Without the plugin that checks this repository, as in an editor; the page of examples has no fault."""
    (tmp_path / "user.py").write_text(USER)
    page = (root / "docs" / "python.md").read_text()
    (tmp_path / "page.py").write_text("\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL)))
    (tmp_path / "none.ini").write_text("[mypy]\nfollow_imports = silent\n")
    words = [
        sys.executable,
        "-m",
        "mypy",
        "--config-file=none.ini",
        "--cache-dir=/dev/null",
        "user.py",
        "page.py",
    ]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    told = {int(number): text for number, text in re.findall(r"user\.py:(\d+): (.*)", done.stdout)[::-1]}
    assert told.keys() == TOLD.keys(), done.stdout
    assert "page.py" not in done.stdout, done.stdout
    for number, text in TOLD.items():
        assert text in told[number].replace("builtins.", "")  # older versions say builtins.int


def test_reports_name_no_temporary_folder(tmp_path):
    mesh = {"vertices": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), "faces": [[0, 1, 2]]}
    scene = {"version": 1, "film": {"width": 4, "height": 3}, "objects": [{"mesh": mesh}]}
    rendering, baking = illum.render(scene, cache=False), illum.bake(scene, samples=4)
    assert rendering.report["scene"] == baking.report["input"] == "scene.yaml"
    assert "'mesh:mesh-" in str(rendering.report["seconds"])
    assert "/illum-" not in f"{rendering.report} {baking.report}"
    assert len(f"{rendering!r}{baking!r}{illum.sweep(scene, {'seed': [1]})!r}") < 300
