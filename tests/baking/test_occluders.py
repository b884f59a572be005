"""What occludes a bake: scenes, objects, files that are not baked, the ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from illumcli.baking.bake import bake_mesh
from illumcli.baking.ground import GAP, Ground
from illumcli.baking.occluder_choice import with_files_at
from illumcli.baking.settings import BakeJob, BakeOptions, BakeSettings
from illumcli.cli import illum
from illumcli.cluster.inputs import Inputs
from illumcli.errors import InputError
from illumcli.visibility.baked import read_npz

SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
CUBE = np.array([(x, y, z) for z in (-1, 1) for x, y in SQUARE])
FACES = ((1, 4, 3, 2), (5, 6, 7, 8), (1, 2, 6, 5), (3, 4, 8, 7), (1, 5, 8, 4), (2, 3, 7, 6))


def cube(path, shift=(0, 0, 0), size=1.0):
    """An OBJ of a cube."""
    lines = ["v {} {} {}".format(*each) for each in (size * CUBE + shift).tolist()]
    path.write_text("\n".join(lines + ["f " + " ".join(map(str, face)) for face in FACES]))
    return path


def two(tmp_path):
    """A scene of two cubes side by side."""
    cube(tmp_path / "cube.obj")
    scene = tmp_path / "two.yaml"
    scene.write_text(
        "version: 1\nobjects:\n- {name: a, mesh: cube.obj}\n"
        "- {name: b, mesh: cube.obj, transform: {translate: [2.2, 0, 0]}}\n"
    )
    return scene


def baked(path, **settings):
    """The values of a bake."""
    out = path.with_suffix(".npz")
    options = BakeOptions(threads=2, force=True)
    bake_mesh(path, [out], BakeSettings(**settings), options)
    return read_npz(out)


def w_of(path, **settings):
    return baked(path, **settings).obscurance


# ------------------------------------------------------------------ ground


@pytest.mark.parametrize("up", Ground.AXES)
def test_a_ground_closes_what_stands_on_it(tmp_path, up):
    w = w_of(cube(tmp_path / "cube.obj"), ground=up, samples=1024)
    axis, sign = "xyz".index(up[-1]), -1 if up[0] == "-" else 1
    low = sign * CUBE[:, axis] < 0
    assert (w[low] < 0.4).all()
    np.testing.assert_allclose(w[~low], 2 / 3, atol=0.02)  # the mean of an open top and two walls on a floor


def test_a_ground_lies_as_far_above_the_lowest_vertex_as_is_said():
    vertices = np.float32([[0, -0.5, 0], [0, 0.25, 0.5]])
    low = Ground.of("y:-0.5").square(vertices, radius=2.0)
    assert np.unique(low[:, 1]) == pytest.approx(-0.75 - GAP)
    high = Ground.of("-y:0.5").square(vertices, radius=2.0)  # y points down: the lowest vertex is at 0.25
    assert np.unique(high[:, 1]) == pytest.approx(GAP)
    for square, sign in ((low, 1), (high, -1)):
        normal = np.cross(square[1] - square[0], square[2] - square[0])
        assert sign * normal[1] > 0


def test_a_ground_farther_below_is_lighter(tmp_path):
    path = cube(tmp_path / "cube.obj")
    near, far, none = (w_of(path, ground=ground, samples=1024).mean() for ground in ("y", "y:-2", None))
    assert near < far < none == 1


@pytest.mark.parametrize("text", ["w", "y:", "y:1m", "+y", "y:inf", "y:0:1"])
def test_what_is_no_ground_is_refused(tmp_path, text):
    done = CliRunner().invoke(
        illum, ["ao-bake", str(cube(tmp_path / "cube.obj")), "-o", "a.npz", "--ground", text]
    )
    assert done.exit_code == 2
    assert f"--ground {text}: is no ground; write the axis that points up" in done.stderr


# ------------------------------------------------------------------ occluders


def test_a_scene_hides_its_objects_from_each_other_or_not(tmp_path):
    scene = two(tmp_path)
    both, own, named, one = (
        w_of(scene, occluders=texts) for texts in ((), ("own",), ("a",), ("scene", "b=own"))
    )
    assert len(both) == 16
    assert both[:8].min() < 0.99
    assert (own == 1).all()
    assert (named[:8] == 1).all()
    assert np.array_equal(named[8:], both[8:])
    assert np.array_equal(one[:8], both[:8])
    assert (one[8:] == 1).all()


def test_files_occlude_in_their_places_and_are_not_baked(tmp_path):
    mesh = cube(tmp_path / "mesh.obj")
    other = cube(tmp_path / "other.obj", shift=(2.2, 0, 0))
    (tmp_path / "scene.yaml").write_text(
        "version: 1\nobjects: [{mesh: mesh.obj, transform: {translate: [2.2, 0, 0]}}]\n"
    )
    expected = baked(two(tmp_path), samples=1024)
    found = [
        baked(mesh, samples=1024, occluders=(str(tmp_path / name),)) for name in ("other.obj", "scene.yaml")
    ]
    for each in found:
        assert len(each.obscurance) == 8
        error = np.hypot(each.standard_error, expected.standard_error[:8])
        assert (np.abs(each.obscurance - expected.obscurance[:8]) <= 4 * error).all()
    assert found[0].obscurance.min() < 0.99
    cube(other, shift=(2.2, 0, 0), size=0.1)
    assert baked(mesh, samples=1024, occluders=(str(other),)).about["content"] != found[0].about["content"]


def test_a_file_may_occlude_a_single_object(tmp_path):
    scene, wall = two(tmp_path), cube(tmp_path / "wall.obj", shift=(0, 0, 2.2))
    w = w_of(scene, occluders=("own", f"a={wall}"))
    assert w[:8].min() < 0.99
    assert (w[8:] == 1).all()


def test_workers_elsewhere_get_occluding_files(tmp_path):
    folder = tmp_path / "far"
    folder.mkdir()
    cube(folder / "part.obj")
    (folder / "scene.yaml").write_text("version: 1\nobjects: [{mesh: part.obj}]\n")
    texts = ("own", f"mesh={folder / 'scene.yaml'}")
    unit = BakeJob(cube(tmp_path / "cube.obj"), (tmp_path / "a.npz",), BakeSettings(occluders=texts))
    assert {path.name for path in Inputs().of_all([unit])} >= {"cube.obj", "scene.yaml", "part.obj"}
    assert with_files_at(texts, lambda path: Path("/there") / path.name) == ("own", "mesh=/there/scene.yaml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "c",
            "--occluders c: no object of that name, and no mesh or scene file; there are: scene, own, a, b",
        ),
        ("c=own", "--occluders c=own: no object is called c; there are: a, b"),
        ("none.obj", "none.obj: "),
    ],
)
def test_unknown_occluders_are_refused(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        w_of(two(tmp_path), occluders=(text,))


def test_an_object_called_own_is_no_occluder_by_that_name(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text("version: 1\nobjects: [{name: own, mesh: {shape: sphere}}]\n")
    with pytest.raises(InputError, match="--occluders own: an object has that name too; give the object"):
        w_of(path, occluders=("own",))
