"""A variant is the same picture whatever was rendered before it in the same process."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

import illumcli as illum

LAMPS = [{"light": "point", "position": [2 - n / 20, 3, n / 20], "intensity": 0.2} for n in range(60)]
SCENE = {
    "version": 1,
    "camera": {"position": [0, 2, 5], "target": [0, 0, 0], "fov": 40},
    "film": {"width": 40, "height": 40},
    "objects": [
        {"mesh": {"shape": "sphere"}, "material": "clay"},
        {"mesh": {"shape": "disc", "radius": 5}, "material": "clay", "transform": {"translate": [0, -1, 0]}},
    ],
    "materials": {"clay": {"model": "phong"}},
    "ambient": 0.3,
    "obscurance": {"samples": 4},
}
"""As many nodes as tiles are larger for, if there are all `LAMPS`."""
CHANGES = {
    "materials.clay.diffuse": [0.2, 0.6],
    "film.filter.width": [1, 3],
    "film.samples": [1, 9],
    "film.adaptive": [True, False],
    "film.width": [24, 40],
    "obscurance.reconstruct": [True, False],
    "lights": [LAMPS[:1], LAMPS],
}
LAYERS = [("beauty",), ("depth",), ("beauty", "error"), ("obscurance", "normal")]
VARIANTS = st.tuples(
    st.fixed_dictionaries({}, optional={path: st.sampled_from(each) for path, each in CHANGES.items()}),
    st.sampled_from(LAYERS),
)


MANY = {"lights": LAMPS}


@settings(max_examples=5, deadline=None)
@example([(MANY, ("depth",)), (MANY, ("beauty",))])
@example([({"obscurance.reconstruct": True}, ("beauty",)), ({}, ("beauty", "error"))])
@example([({"film.samples": 9, "film.filter.width": width}, ("beauty",)) for width in (1, 3)])
@given(st.lists(VARIANTS, min_size=2, max_size=4))
def test_variants_depend_on_none_before_them(variants):
    loaded = illum.load(SCENE)
    for overrides, layers in variants:
        picture = loaded.render(overrides, layers=layers, cache=False).picture
        alone = illum.render(SCENE, overrides, layers=layers, cache=False).picture
        for name, pixels in alone.items():
            np.testing.assert_array_equal(picture[name], pixels)


def test_many_lights_are_traced_once():
    loaded = illum.load(SCENE | MANY)
    first, second = (loaded.render({"materials.clay.diffuse": each}, cache=False) for each in (0.2, 0.6))
    assert len(first.report["rays"]) == len(LAMPS) + 2  # and those of hits and obscurance
    assert second.report["rays"] == {}
