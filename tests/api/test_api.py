"""The commands as functions: the same pixels, nothing written, errors that name the scene."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from types import SimpleNamespace

import numpy as np
import pytest

import illumcli
from illumcli.images.reader import read_image
from illumcli.visibility.baked import read_npz

BOX = {"vertices": np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]]), "faces": [[0, 1, 2], [0, 2, 3]]}
SCENE = {
    "version": 1,
    "film": {"width": 24, "height": 16, "samples": 2},
    "ambient": 0.3,
    "obscurance": {"samples": 4},
    "materials": {"clay": {"model": "oren_nayar", "sigma": 0.2}},
    "objects": [{"mesh": {"shape": "torus"}, "material": "clay"}, {"mesh": {"shape": "plane"}}],
    "lights": [{"light": "point", "position": np.array([3.0, 4.0, 2.0]), "intensity": 20}],
    "outputs": {"layers": ["beauty", "obscurance", "object_id", "depth"]},
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def scene_file(folder):
    (folder / "s.yaml").write_text("""\
version: 1
film: {width: 24, height: 16, samples: 2}
ambient: 0.3
obscurance: {samples: 4}
materials: {clay: {model: oren_nayar, sigma: 0.2}}
objects: [{mesh: {shape: torus}, material: clay}, {mesh: {shape: plane}}]
lights: [{light: point, position: [3, 4, 2], intensity: 20}]
outputs: {layers: [beauty, obscurance, object_id, depth]}
""")
    return folder / "s.yaml"


def test_saved_pictures_are_those_of_the_command(illum, folder, scene_file):
    rendering = illumcli.render(scene_file, {"materials.clay.sigma": 0.4})
    assert sorted(path.name for path in folder.iterdir()) == ["s.yaml"]
    for pattern in ("{scene}.exr", "{scene}.{layer}.png"):
        illum("render", "s.yaml", "-D", "materials.clay.sigma=0.4", "-o", f"cli/{pattern}")
        saved = rendering.save(folder / "api" / pattern)
        assert all(path.read_bytes() == (folder / "cli" / path.name).read_bytes() for path in saved)
    assert len(list((folder / "api").iterdir())) == 5


def test_arrays_have_the_types_of_their_layers(scene_file):
    rendering = illumcli.render(scene_file, cache=False)
    shapes = {name: (layer.shape, layer.dtype.name) for name, layer in rendering.picture.items()}
    assert shapes == {
        "beauty": ((16, 24, 4), "float32"),
        "obscurance": ((16, 24, 1), "float32"),
        "object_id": ((16, 24, 1), "uint32"),
        "depth": ((16, 24, 1), "float32"),
    }
    assert set(np.unique(rendering["object_id"])) <= {0, 1, 2}
    assert rendering.picture.metadata["illum:seed"] == "0"
    assert rendering.report["rays"]["obscurance"] > 0
    assert rendering.report["written"] == ()


def test_a_mapping_a_description_and_a_file_are_one_scene(scene_file):
    plain = SCENE | {"lights": [{**SCENE["lights"][0], "position": (3.0, 4.0, 2.0)}]}
    description = illumcli.Scene.model_validate(plain)
    pictures = [illumcli.render(each)["beauty"] for each in (SCENE, description, str(scene_file))]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


def test_overrides_are_a_mapping_or_texts(scene_file):
    one = illumcli.render(scene_file, {"film.width": 20, "lights.0.position": np.array([1.0, 2.0, 3.0])})
    other = illumcli.render(scene_file, ["film.width=20", "lights.0.position=[1, 2, 3]"])
    np.testing.assert_array_equal(one["beauty"], other["beauty"])


def test_a_loaded_scene_casts_no_ray_again_for_a_material(scene_file):
    loaded = illumcli.load(scene_file)
    first = loaded.render(cache=False)
    second = loaded.render({"materials.clay.sigma": 0.5}, cache=False)
    assert sum(first.report["rays"].values()) > 0
    assert sum(second.report["rays"].values()) == 0
    fresh = illumcli.render(scene_file, {"materials.clay.sigma": 0.5}, cache=False)
    np.testing.assert_array_equal(second["beauty"], fresh["beauty"])
    np.testing.assert_array_equal(first["beauty"], illumcli.render(scene_file, cache=False)["beauty"])


def test_threads_that_render_one_loaded_scene_take_turns(scene_file):
    loaded, sigmas = illumcli.load(scene_file), (0.1, 0.4, 0.7, 1.0)
    together = Barrier(len(sigmas))

    def rendered(sigma):
        together.wait()
        return loaded.render({"materials.clay.sigma": sigma}, cache=False)["beauty"]

    with ThreadPoolExecutor(len(sigmas)) as pool:
        pictures = list(pool.map(rendered, sigmas))
    for sigma, picture in zip(sigmas, pictures, strict=True):
        alone = illumcli.render(scene_file, {"materials.clay.sigma": sigma}, cache=False)
        np.testing.assert_array_equal(picture, alone["beauty"])


@pytest.mark.parametrize("like", [BOX, SimpleNamespace(**BOX), BOX | {"uv": np.zeros((4, 2))}])
def test_meshes_are_arrays(like):
    scene = SCENE | {"meshes": {"own": like}, "objects": [{"mesh": "own", "material": "clay"}]}
    polygons = {"shape": "polygons", "vertices": BOX["vertices"], "faces": BOX["faces"]}
    expected = illumcli.render(scene | {"meshes": {"own": polygons}})
    np.testing.assert_array_equal(illumcli.render(scene)["beauty"], expected["beauty"])


@pytest.mark.parametrize(
    ("mesh", "fact"),
    [
        (BOX | {"faces": [[0, 1, 9]]}, "faces name vertices 0 to 9, there are 0 to 3"),
        (BOX | {"faces": [[0.0, 1, 2]]}, "faces must be vertex numbers"),
        (BOX | {"vertices": np.zeros(4)}, "vertices must be an array of N x 3"),
        (BOX | {"normals": np.zeros((3, 3))}, "4 vertices and 3 normals"),
        (BOX | {"vertices": np.zeros((4, 3), complex)}, "N x 3 numbers, is complex128"),
        (BOX | {"vertices": [["a", "b", "c"]] * 4}, "N x 3 numbers, is <U1"),
        (BOX | {"vertices": [[0, 0], [1]]}, "has rows of several lengths"),
        (BOX | {"vertices": np.full((4, 3), np.nan)}, "^mesh: 4 of 4 vertices are not finite"),
        (BOX | {"colour": 1}, "mesh: unknown key 'colour'; there are: vertices, faces, normals, uv"),
        (BOX | {"normal": 1}, "mesh: unknown key 'normal'; did you mean 'normals'?"),
    ],
)
def test_faulty_meshes_are_refused(mesh, fact):
    with pytest.raises(illumcli.IllumError, match=fact):
        illumcli.bake(mesh)
    with pytest.raises(illumcli.IllumError, match=fact):
        illumcli.render(SCENE | {"objects": [{"mesh": mesh}]})


def test_errors_name_the_scene_and_all_faults():
    with pytest.raises(illumcli.IllumError) as stop:
        illumcli.render(SCENE | {"film": {"width": -1}, "seed": -2})
    assert str(stop.value).splitlines() == [
        "scene: film.width: must be at least 1, is -1",
        "scene: seed: must be at least 0, is -2",
    ]
    with pytest.raises(illumcli.IllumError, match=r"scene: film\.width: a scene holds no object"):
        illumcli.render(SCENE | {"film": {"width": object()}})


@pytest.mark.parametrize("scene", [3, None, [SCENE], b"scene.yaml"])
def test_what_is_no_scene_is_refused(scene):
    for function in (illumcli.render, illumcli.load, illumcli.bake):
        with pytest.raises(illumcli.IllumError, match=r"scene: must be a path, .*, is of type"):
            function(scene)


@pytest.mark.parametrize(
    ("value", "fact"),
    [
        (float("nan"), "must be a finite number, is nan"),
        (np.float32("inf"), "must be a finite number, is inf"),
        (np.array([0.1, np.nan]), "must be finite numbers"),
    ],
)
def test_numbers_are_finite(value, fact):
    with pytest.raises(illumcli.IllumError, match=f"scene: materials.clay.sigma: {fact}"):
        illumcli.render(SCENE, {"materials.clay.sigma": value})
    with pytest.raises(illumcli.IllumError, match=f"scene: materials.clay.sigma: {fact}"):
        illumcli.load(SCENE | {"materials": {"clay": {"model": "oren_nayar", "sigma": value}}})


def test_one_text_is_one_override_and_one_layer(scene_file):
    rendering = illumcli.render(scene_file, "film.width=9", layers="depth")
    assert {name: each.shape for name, each in rendering.picture.items()} == {"depth": (16, 9, 1)}
    with pytest.raises(KeyError, match="no layer 'beauty'; there are: depth"):
        rendering["beauty"]


def test_paths_of_a_mapping_start_in_the_current_folder(folder):
    (folder / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    illumcli.render(SCENE | {"objects": [{"mesh": "m.obj"}]})
    with pytest.raises(illumcli.IllumError, match=r"no file .*n\.obj"):
        illumcli.render(SCENE | {"objects": [{"mesh": "n.obj"}]})


def test_frames_come_as_a_list(scene_file):
    curve = {"materials.clay.sigma": {"curve": "linear", "keys": {"0": 0, "4": 0.4}}}
    frames = illumcli.render(scene_file, curve, frames="0:4:2")
    assert [each.frame for each in frames] == [0, 2, 4]
    np.testing.assert_array_equal(
        frames[1]["beauty"], illumcli.render(scene_file, {"materials.clay.sigma": 0.2})["beauty"]
    )


def test_a_target_error_is_reached_and_told():
    report = illumcli.render(SCENE, {"outputs.layers": ["beauty"]}, target_error=0.05).report
    assert report["error"]["target"] == 0.05
    assert report["chosen"]


def test_progress_is_told_and_can_cancel(scene_file):
    told = []
    illumcli.render(scene_file, cache=False, progress=lambda *each: told.append(each))
    assert told[-1] == ("main", 384, 384)

    def stop(what, done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        illumcli.render(scene_file, cache=False, progress=stop)


def test_notebooks_show_a_png(scene_file):
    rendering = illumcli.render(scene_file)
    (beauty, *_) = rendering.save("x.{layer}.png")
    shown = Path("shown.png")
    shown.write_bytes(rendering._repr_png_())
    for name, values in read_image(beauty).channels.items():
        np.testing.assert_array_equal(read_image(shown).channels[name], values)


def test_an_existing_file_stays_unless_forced(scene_file):
    illumcli.render(scene_file).save("x.exr")
    other = illumcli.render(scene_file, {"ambient": 0.9})
    with pytest.raises(illumcli.IllumError, match=r"x\.exr"):
        other.save("x.exr")
    other.save("x.exr", force=True)


def test_a_sweep_is_a_table_of_records(scene_file):
    values = {"materials.clay.sigma": [0.1, 0.5], "ambient": [0.1, 0.2]}
    table = illumcli.sweep(scene_file, values, reference=0, cache=False)
    assert [(row["materials.clay.sigma"], row["ambient"]) for row in table] == [
        (0.1, 0.1),
        (0.1, 0.2),
        (0.5, 0.1),
        (0.5, 0.2),
    ]
    assert [row["rays"] > 0 for row in table] == [True, False, False, False]
    assert table[0]["rmse"] == 0 < table[1]["rmse"]
    single = illumcli.render(scene_file, {"materials.clay.sigma": 0.5, "ambient": 0.1})
    np.testing.assert_array_equal(table.renderings[2]["beauty"], single["beauty"])
    pairs = illumcli.sweep(scene_file, {"ambient": [0, 1], "seed": [1, 2]}, together=True)
    assert [row["seed"] for row in pairs] == [1, 2]
    with pytest.raises(illumcli.IllumError, match="different lengths"):
        illumcli.sweep(scene_file, {"ambient": [0, 1], "seed": [1]}, together=True)


@pytest.mark.parametrize(
    ("values", "reference", "fact"),
    [
        ({"ambient": 0.1}, None, r"ambient: give its values as a list, \[0.1\]"),
        ({"ambient": "0.1"}, None, "ambient: give its values as a list"),
        ({"ambient": [0.1]}, 1, "reference 1: there are 1 variants, numbered from 0"),
        ({"film.width": [8, 9]}, 0, r"'film.width': 9}: is \(16, 9, 3\), but the reference \(16, 8, 3\)"),
    ],
)
def test_faulty_sweeps_are_refused(scene_file, values, reference, fact):
    with pytest.raises(illumcli.IllumError, match=fact):
        illumcli.sweep(scene_file, values, reference=reference)


def test_pictures_arrays_and_files_are_compared(scene_file):
    one, other = illumcli.render(scene_file), illumcli.render(scene_file, {"ambient": 0.4})
    (path,) = other.save("other.exr")
    by_file = illumcli.compare(one, path, ["obscurance", "beauty"], flip=False)
    assert by_file["obscurance"]["rmse"] == 0
    square = np.square(one["beauty"].astype(float) - other["beauty"]).mean() ** 0.5
    assert illumcli.compare(one["beauty"], other["beauty"])["beauty"]["rmse"] == pytest.approx(square)
    assert by_file["beauty"]["rmse"] == pytest.approx(square, rel=1e-2)  # of halves
    with pytest.raises(illumcli.IllumError, match="is 3 x 2, but reference is 24 x 16"):
        illumcli.compare(one, np.zeros((2, 3, 4)))


def test_baked_values_are_those_of_the_command(illum, folder):
    (folder / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\n")
    baking = illumcli.bake("m.obj", samples=32, what=["ao", "bent_normal"])
    assert sorted(path.name for path in folder.iterdir()) == ["m.obj"]
    illum("ao-bake", "m.obj", "-o", "m.npz", "--samples", 32, "--what", "ao,bent_normal")
    expected = read_npz(folder / "m.npz")
    for name, values in expected.channels.items():
        np.testing.assert_array_equal(baking.channels[name], values)
    assert baking.obscurance is baking.channels["obscurance"]
    illumcli.bake("m.obj", ["m2.npz"], samples=32, what=["ao", "bent_normal"])
    np.testing.assert_array_equal(read_npz(folder / "m2.npz").obscurance, expected.obscurance)


def test_settings_of_a_bake_are_numbers_of_numpy_too_and_checked():
    few, same = illumcli.bake(BOX, samples=np.int64(8)), illumcli.bake(BOX, samples=8)
    np.testing.assert_array_equal(few.obscurance, same.obscurance)
    with pytest.raises(illumcli.IllumError, match=r"^samples: must be at least 1, is 0$"):
        illumcli.bake(BOX, samples=0)


def test_the_import_loads_nothing_heavy():
    code = "import sys, illumcli; print(sorted({'numpy', 'pydantic', 'click', 'yaml'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    with pytest.raises(AttributeError, match="no attribute 'rendr'"):
        illumcli.rendr  # noqa: B018
    assert set(illumcli.__all__) <= set(dir(illumcli))
