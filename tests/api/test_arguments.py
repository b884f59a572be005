"""What users of a notebook hand over: numbers of numpy and tables, paths, one for several, and mistakes."""

from __future__ import annotations

import copy
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import illumcli as illum

SCENE = {
    "version": 1,
    "film": {"width": 12, "height": 8, "samples": 1},
    "ambient": 0.2,
    "objects": [{"mesh": {"shape": "sphere", "segments": 8, "rings": 4}}],
}
MESH = {"vertices": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), "faces": [[0, 1, 2], [0, 1, 3]]}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (({"film.width": np.float64(10)}, {}), ({"film.width": 10}, {})),
        (({"film.width": 10.0, "seed": np.uint8(3)}, {}), (["film.width=10", "seed=3"], {})),
        (({"film.adaptive": np.bool_(True)}, {}), ("film.adaptive=true", {})),
        ((None, {"seed": np.int64(3), "threads": np.int64(1)}), ({}, {"seed": 3})),
        (((), {"layers": None, "seed": None, "target_error": None}), ((), {})),
    ],
)
def test_numbers_are_taken_as_meant(one, other):
    pictures = [
        illum.render(SCENE, given, cache=False, **options)["beauty"] for given, options in (one, other)
    ]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        ({"layer": "depth"}, "layer: unknown key 'layer'; did you mean 'layers'?"),
        ({"layers": 3}, "layers: must be a list, is 3"),
        (
            {"seed": "3", "threads": 0, "target_error": -1},
            "seed: must be a whole number, is text '3'\nthreads: must be at least 1, is 0\n"
            "target_error: must be above 0, is -1",
        ),
        (
            {"overrides": 3},
            "overrides: must be a mapping from paths to values, or texts as PATH=VALUE, is of type int",
        ),
        ({"overrides": [3]}, "overrides: must be a mapping .*, is of type int"),
        ({"overrides": {3: 1}}, "overrides: a path must be text, is 3"),
        ({"frames": -1}, "frames: must be whole numbers, at least 0, .*, is -1"),
        ({"frames": [0.5]}, "frames: must be whole numbers, at least 0, .*, is 0.5"),
    ],
)
def test_faulty_options_are_told_all_at_once(options, facts):
    with pytest.raises(illum.IllumError, match=f"^{facts}"):
        illum.render(SCENE, **options)


def test_a_limit_names_the_scene(monkeypatch):
    monkeypatch.setattr("illumcli.memory.free_memory", lambda: 1)
    with pytest.raises(illum.IllumError, match=r"^scene: "):
        illum.render(SCENE)


def test_one_output_of_a_bake_is_a_path(folder):
    for output in ("a.npz", folder / "b.npz", ["c.npz"]):
        illum.bake(MESH, output, samples=np.float64(4), what="ao")
    assert sorted(path.name for path in folder.iterdir()) == ["a.npz", "b.npz", "c.npz"]


def test_a_bake_to_an_error_is_that_of_the_command(illum, folder):
    import illumcli

    (folder / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\n")
    done = illum("ao-bake", "m.obj", "-o", "cli.npz", "--target-error", 0.05)
    assert done.returncode == 0, done.stderr
    illumcli.bake("m.obj", "api.npz", target_error=0.05)
    assert (folder / "api.npz").read_bytes() == (folder / "cli.npz").read_bytes()


def test_a_bake_of_a_scene_takes_overrides():
    few, more = (
        illum.bake(SCENE, overrides={"objects.0.mesh.segments": each}, samples=4).obscurance
        for each in (8, 16)
    )
    assert len(few) < len(more)


@pytest.mark.parametrize(
    ("options", "fact"),
    [
        ({"sample": 4}, "sample: unknown key 'sample'; did you mean 'samples'?"),
        ({"samples": 4, "target_error": 0.1}, "samples and target_error exclude each other"),
        ({"what": ["aoo"]}, "what: no 'aoo'; did you mean 'ao'?"),
        ({"method": "fitt"}, "method: no choice 'fitt'; did you mean 'fit'?"),
        ({"method": "fit", "reconstruct": True}, "reconstruct works with method='vertex'"),
        ({"method": "fit", "what": ["ao", "bent_normal"]}, "what works with method='vertex'"),
        ({"method": "fit", "target_error": 0.1}, "target_error works with method='vertex'"),
        ({"bits": 7}, "bits: must be 8 or 16, is 7"),
    ],
)
def test_faulty_options_of_a_bake_are_told(options, fact):
    with pytest.raises(illum.IllumError, match=f"^{fact}"):
        illum.bake(MESH, **options)


def test_values_of_a_sweep_are_anything_that_can_be_listed():
    reference = illum.render(SCENE)
    for values in (np.array([1, 2]), range(1, 3), (each for each in (1, 2))):
        table = illum.sweep(SCENE, {"seed": values}, reference=reference)
        assert [(type(row["seed"]), row["seed"]) for row in table] == [(int, 1), (int, 2)]
        assert table[0]["rmse"] == 0
    assert illum.sweep(SCENE, {"seed": [1, 2]}, reference=np.int64(0))[0]["rmse"] == 0
    for values, fact in ((None, "values: must be a mapping"), ({"seed": []}, "seed: has no values")):
        with pytest.raises(illum.IllumError, match=fact):
            illum.sweep(SCENE, values)
    with pytest.raises(illum.IllumError, match="seed: give its values as a list"):
        illum.sweep(SCENE, {"seed": np.array(3)})


def test_a_rendering_is_a_mapping_of_layers_that_stay():
    rendering = illum.render(SCENE, layers=["beauty", "depth"])
    assert list(rendering) == ["beauty", "depth"]
    assert "depth" in rendering
    assert dict(rendering).keys() == {"beauty", "depth"}
    assert rendering != illum.render(SCENE, layers=["beauty", "depth"])
    with pytest.raises(KeyError, match="no layer 0; there are: beauty, depth"):
        rendering[0]
    with pytest.raises(ValueError, match="read-only"):
        rendering["beauty"] *= 2
    again = pickle.loads(pickle.dumps(rendering))
    np.testing.assert_array_equal(again["depth"], rendering["depth"])
    assert again.save("x.exr")[0].read_bytes() == rendering.save("y.exr")[0].read_bytes()
    assert copy.copy(rendering)._repr_png_() == rendering._repr_png_()


def test_a_loaded_scene_stays_in_its_process():
    loaded = illum.load(SCENE)
    assert repr(loaded) == "<scene scene.yaml>"
    for copied in (pickle.dumps, copy.copy):
        with pytest.raises(TypeError, match="stays in its process"):
            copied(loaded)


def test_arrays_in_8_bits_are_display_values():
    rendering, other = illum.render(SCENE), illum.render(SCENE, {"ambient": 0.3})
    one, two = Path("a.png"), Path("b.png")
    rendering.save(one)
    other.save(two)
    by_file = illum.compare(one, two, flip=False)["beauty"]["rmse"]
    by_array = illum.compare(rendering.display(), other.display(), flip=False)["beauty"]["rmse"]
    assert by_array == pytest.approx(by_file, rel=1e-5)
    with pytest.raises(illum.IllumError, match="is int64"):
        illum.compare(np.zeros((2, 2, 3), np.int64), np.zeros((2, 2, 3)))
    with pytest.raises(illum.IllumError, match="holds display values, but reference linear light"):
        illum.compare(rendering, rendering.display())


def test_each_render_reads_changed_files_anew():
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    Path("m.obj").write_text(triangle)
    scene = SCENE | {"objects": [{"mesh": "m.obj"}]}
    loaded = illum.load(scene)
    before = loaded.render()["beauty"]
    Path("m.obj").write_text(triangle.replace("v 1 0 0", "v 2 0 0"))
    os.utime("m.obj", (1, 1))
    after = illum.render(scene)["beauty"]
    assert (before != after).any()
    np.testing.assert_array_equal(illum.load(scene).render()["beauty"], after)
    np.testing.assert_array_equal(loaded.render({"film.exposure": 1})["beauty"], before)
