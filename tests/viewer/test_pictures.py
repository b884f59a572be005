"""Pictures of windows: those of ``illum render``, whatever was shown before."""

from __future__ import annotations

import numpy as np
import pytest

import illumcli as illum
from illumcli.cache.memory import arrays_in
from illumcli.images.reader import read_image
from illumcli.progress import no_progress
from illumcli.viewer.changes import changed, reread
from illumcli.viewer.pictures import Renderer
from illumcli.viewer.quality import Coarse, Reconstructed, reconstructed


class Shot:
    """A window without a session: messages, then pictures."""

    def __init__(self, path, given=()):
        self.renderer = Renderer(path, given, threads=1)
        self.window, _ = reread(None, self.renderer.read(), self.renderer.loaded)
        self.last = None

    def tell(self, **message):
        scene = self.window.now.scene
        camera = self.last.camera if self.last else scene.named_cameras()[self.window.camera]
        self.window = changed(self.window, message, self.renderer.loaded, camera)

    def picture(self, quality=None, progress=no_progress):
        self.last = self.renderer.picture(self.window, quality, progress)
        return self.last


@pytest.fixture
def shot(scene):
    return Shot(scene)


def assert_rendered(shot, layer="beauty"):
    """The full picture is what ``illum render`` makes with the window's overrides, bit for bit."""
    picture = shot.picture()
    options = {"layers": [layer], "cache": False, "threads": 1}
    given = (*shot.renderer.given, *shot.window.overrides)
    rendered = illum.render(shot.renderer.path, given, **options).pictures[shot.window.camera]
    assert picture.layers()[layer].tobytes() == rendered[layer].tobytes()


def test_full_pictures_are_those_of_render(shot):
    assert_rendered(shot)
    shot.picture(Coarse(2, 4))
    shot.tell(type="set", path="materials.clay.diffuse", value=[0.1, 0.5, 0.3])
    shot.picture(Coarse(2, 4))
    assert_rendered(shot)
    shot.tell(type="move", orbit=[0.1, -0.05])
    shot.tell(type="move", dolly=0.2)
    shot.tell(type="view", width=80, height=60, exposure=1.5, hidden_lights=["fill"])
    shot.picture(Coarse(3, 4))
    assert_rendered(shot)
    shot.tell(type="set", path="materials.clay.model", value="ward")
    shot.tell(type="view", hidden_lights=[])
    assert_rendered(shot)
    shot.tell(type="view", layer="shadow.key")
    assert_rendered(shot, "shadow.key")


def test_those_of_many_samples_reconstructed_and_of_a_camera_of_its_own_size(scene):
    text = scene.read_text().replace("samples: 4, falloff", "samples: 4, reconstruct: true, falloff")
    text = text.replace("fov: 35}", "fov: 35, width: 64, height: 48, samples: 9}")
    scene.write_text(text)
    shot = Shot(scene, ["materials.clay.exponent=50"])
    shot.picture(Coarse(2, 4))
    assert_rendered(shot)
    assert shot.last.error > 0
    shot.tell(type="view", width=72, height=40)
    shot.picture(Coarse(2, 4))
    assert_rendered(shot)


def test_reconstructed_pictures_are_those_of_render_and_leave_the_full_ones_as_they_are(shot):
    shot.tell(type="set", path="film.samples", value=2)
    quality = reconstructed(shot.window.scene, "main")
    assert quality == Reconstructed(2)
    for message in (
        {"type": "set", "path": "materials.clay.diffuse", "value": [0.1, 0.5, 0.3]},
        {"type": "move", "orbit": [0.1, 0]},
    ):
        picture = shot.picture(quality)
        given = (*shot.window.overrides, "obscurance.samples=2", "obscurance.reconstruct=true")
        rendered = illum.render(shot.renderer.path, given, cache=False, threads=1).pictures["main"]
        assert picture.layers()["beauty"].tobytes() == rendered["beauty"].tobytes()
        assert picture.error > 0
        assert_rendered(shot)
        shot.tell(**message)


@pytest.mark.parametrize(
    ("film", "obscurance", "rays"),
    [(1, "{samples: 64}", 4), (4, "{samples: 16}", 1), (9, "{samples: 2}", 1), (1, "{samples: 7}", None),
     (4, "{samples: 16, reconstruct: true}", None), (4, "null", None)],
)  # fmt: skip
def test_few_rays_of_a_pixel_are_those_of_its_samples(scene, film, obscurance, rays):
    shot = Shot(scene, [f"film.samples={film}", f"obscurance={obscurance}"])
    quality = reconstructed(shot.window.scene, "main")
    assert quality == (None if rays is None else Reconstructed(rays))


def test_obscurance_rays_of_the_full_picture_are_known_before_it(shot):
    shot.picture(Coarse(2, 4))
    most = 96 * 54 * 4
    assert shot.renderer.obscurance_rays(shot.window) == most
    shot.picture(Reconstructed(1))
    assert shot.renderer.obscurance_rays(shot.window) == most
    full = shot.picture()
    assert 0 < full.report.rays["obscurance"] <= most
    assert 0 < full.ray_seconds * full.report.rays["obscurance"] <= full.seconds
    assert shot.picture().ray_seconds is None
    for message, rays in (
        ({"type": "set", "path": "materials.clay.diffuse", "value": [0.1, 0.5, 0.3]}, 0),
        ({"type": "set", "path": "lights.key.position", "value": [-2, 5, 3]}, 0),
        ({"type": "view", "layer": "normal"}, 0),
        ({"type": "view", "layer": "beauty"}, 0),
        ({"type": "move", "orbit": [0.1, 0]}, most),
        ({"type": "view", "layer": "normal"}, 0),
    ):
        shot.tell(**message)
        shot.picture(Coarse(2, 4))
        assert shot.renderer.obscurance_rays(shot.window) == rays, message


def test_a_reconstructed_picture_gives_way_during_its_audit(shot):
    shot.tell(type="set", path="film.samples", value=2)
    calls = []

    def stop(what, done, total):
        calls.append(done)
        if calls.count(total) == 2:  # the picture is complete
            raise Enough

    with pytest.raises(Enough):
        shot.picture(Reconstructed(1), stop)
    assert_rendered(shot)


def test_several_cameras_of_which_one_fits_an_object(scene):
    line = "camera: {position: [0, 1.2, 4], target: [0, 0.6, 0], fov: 35}"
    near = "{position: [1, 1, 1], fit: ball, projection: orthographic}"
    scene.write_text(scene.read_text().replace(line, f"cameras: {{far: {{}}, near: {near}}}"))
    shot = Shot(scene)
    assert_rendered(shot)
    shot.tell(type="view", camera="near")
    shot.picture(Coarse())
    shot.tell(type="move", pan=[0.1, 0])
    assert shot.window.now.scene.cameras["near"].fit is None
    assert shot.window.now.scene.cameras["far"] == shot.window.original.scene.cameras["far"]
    assert_rendered(shot)


def test_a_mesh_is_shown_in_the_studio(tmp_path):
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0.2\nf 1 2 3\n")
    shot = Shot(mesh, ["studio.view=[10,20]", "film={width: 48, height: 27, samples: 1}"])
    shot.picture(Coarse())
    shot.tell(type="move", orbit=[0.1, 0])
    assert_rendered(shot)


@pytest.mark.parametrize("background", ["", "background: [0.1, 0.1, 0.1], "])
@pytest.mark.parametrize("layer", ["beauty", "depth", "normal", "object_id", "obscurance"])
def test_pixels_are_those_of_the_png(scene, tmp_path, layer, background):
    scene.write_text(scene.read_text().replace("background: [0.1, 0.1, 0.1]", f"{background}exposure: -0.5"))
    shot = Shot(scene)
    shot.tell(type="view", layer=layer)
    pixels = shot.picture().pixels()
    illum.render(scene, layers=[layer], threads=1).save(tmp_path / "picture.png")
    stored = read_image(str(tmp_path / "picture.png")).channels
    names = ["Y"] if "Y" in stored else ["R", "G", "B"]
    expected = np.stack([np.rint(255 * stored[name]) for name in names], axis=-1)
    opaque = stored["A"] == 1 if "A" in stored else np.ones(pixels.shape[:2], bool)
    assert opaque.any()
    assert (pixels[opaque] == expected[opaque]).all()
    if not opaque.all():
        assert (pixels[stored["A"] == 0] == 36).all()


def test_no_material_casts_a_ray_however_pictures_alternate(shot):
    for _ in range(2):
        shot.picture(Coarse(1, 4))
        shot.picture()
    for number, change in enumerate(
        (
            {"type": "set", "path": "materials.clay.diffuse", "value": [0.1, 0.2, 0.3]},
            {"type": "set", "path": "materials.clay.model", "value": "oren_nayar"},
            {"type": "set", "path": "lights.key.intensity", "value": [3, 4, 5]},
            {"type": "set", "path": "ambient", "value": [0.2, 0.2, 0.2]},
            {"type": "view", "exposure": 2},
        )
    ):
        shot.tell(**change)
        assert shot.picture(Coarse(1, 4)).rays == 0, number
        assert shot.picture().rays == 0, number
    shot.tell(type="set", path="lights.key.position", value=[-2, 5, 3])
    for coarse in (Coarse(1, 4), None):
        assert set(shot.picture(coarse).report.rays) == {"shadow:key"}


def test_layers_that_were_seen_cast_no_ray_again_until_the_camera_moves(shot):
    layers = ["beauty", "obscurance", "normal", "shadow.key", "beauty", "obscurance", "shadow.key"]
    rays = []
    for layer in layers:
        shot.tell(type="view", layer=layer)
        rays.append((shot.picture(Coarse(2, 4)).rays, shot.picture().rays))
    assert rays[1:] == [(0, 0)] * 6
    shot.tell(type="move", orbit=[0.1, 0])
    shot.picture(Coarse(2, 4))
    assert len(shot.renderer._lasting) == 5  # the coarse picture, and four full ones of before
    shot.picture()
    assert len(shot.renderer._lasting) == 2


def test_reconstructed_buffers_stay_until_the_full_picture_is_there(shot):
    shot.picture(Coarse(2, 4))
    shot.picture(Reconstructed(1))
    shot.tell(type="set", path="materials.clay.diffuse", value=[0.1, 0.5, 0.3])
    shot.picture(Coarse(2, 4))
    assert set(shot.picture(Reconstructed(1)).report.rays) <= {"audit"}
    shot.picture()
    assert len(shot.renderer._lasting) == 2


class Enough(Exception):
    pass


def test_an_abandoned_picture_leaves_nothing_behind(shot):
    shot.picture()
    memory = shot.renderer._worker.shared(shot.renderer.path).memory

    def held():
        return sum(array.nbytes for tiles in memory._tiles.values() for array in arrays_in(tiles))

    for turn in range(3):
        shot.tell(type="move", orbit=[0.1, 0])

        def stop(what, done, total):
            raise Enough

        with pytest.raises(Enough):
            shot.picture(None, stop)
        assert held() == memory._bytes, turn
    assert_rendered(shot)
    assert held() == memory._bytes


def test_a_picture_that_is_given_up_costs_no_other_one_its_rays(shot):
    def stop(what, done, total):
        raise Enough

    for coarse in (Coarse(2, 4), Coarse(1, 4), None):
        shot.picture(coarse)
    shot.tell(type="view", width=100, height=60)
    for coarse in (Coarse(2, 4), None):
        with pytest.raises(Enough):
            shot.picture(coarse, stop)
    shot.tell(type="view", width=96, height=54)
    shot.tell(type="set", path="materials.clay.exponent", value=3)
    assert shot.picture(Coarse(1, 4)).rays == 0
    assert shot.picture().rays == 0


def test_memory_does_not_grow_with_the_number_of_pictures(shot):
    memory = shot.renderer._worker.shared(shot.renderer.path).memory
    sizes = []
    for _ in range(6):
        shot.tell(type="move", orbit=[0.05, 0.01])
        shot.picture(Coarse(2, 4))
        shot.picture()
        sizes.append((len(memory.once), len(memory._tiles), len(memory.pixels)))
    assert len(set(sizes[2:])) == 1, sizes


def test_a_faulty_file_leaves_the_scene_as_it_was(shot, scene):
    before = shot.picture().layers()["beauty"]
    text = scene.read_text()
    scene.write_text(text.replace("phong", "phng"))
    with pytest.raises(illum.IllumError, match=r"ball.yaml:7:10: .*'phong'"):
        shot.renderer.read()
    assert (shot.picture().layers()["beauty"] == before).all()
    scene.write_text(text.replace("[0.6, 0.2, 0.1]", "[0.1, 0.2, 0.6]"))
    shot.window, problems = reread(shot.window, shot.renderer.read(), shot.renderer.loaded)
    assert problems == ()
    picture = shot.picture()
    assert picture.rays == 0  # the geometry is the same
    assert (picture.layers()["beauty"] != before).any()


def test_edits_outlive_a_change_of_the_file_if_they_can(shot, scene):
    shot.tell(type="set", path="materials.clay.exponent", value=7)
    shot.tell(type="set", path="materials.floor.diffuse", value=0.2)
    shot.tell(type="view", hidden_lights=["fill"], layer="fill", camera="main")
    text = scene.read_text().replace("floor: {model: lambert, diffuse: 0.5}", "")
    scene.write_text(text.replace("material: floor", "material: clay").replace("name: fill", "name: back"))
    window, problems = reread(shot.window, shot.renderer.read(), shot.renderer.loaded)
    assert dict(window.edits) == {"materials.clay.exponent": 7}
    assert window.now.scene.materials["clay"].exponent == 7
    assert len(problems) == 1
    assert "floor" in problems[0]
    assert (window.layer, window.hidden_lights) == ("beauty", frozenset())


def test_views_that_there_are_not_are_refused(shot):
    before = shot.window.choices
    for part, fact in (
        ({"camera": "man"}, "did you mean 'main'"),
        ({"layer": "beaty"}, "did you mean 'beauty'"),
        ({"hidden_lights": ["kay"]}, "did you mean 'key'"),
        ({"width": 0, "height": 5}, "must be 1 to"),
        ({"width": 10**9, "height": 5}, "must be 1 to"),
        ({"exposure": 1e9}, "must be between"),
        ({"exposure": float("nan")}, "must be between"),
    ):
        with pytest.raises(illum.IllumError, match=fact):
            shot.tell(type="view", **part)
    for message in (
        {"type": "move"},
        {"type": "move", "orbit": [1]},
        {"type": "move", "dolly": 1e99},
        {"type": 3},
    ):
        with pytest.raises((LookupError, TypeError, ValueError)):
            shot.tell(**message)
    assert shot.window.choices == before


def test_restored_edits_replace_all_others(shot):
    shot.tell(type="set", path="materials.clay.exponent", value=7)
    shot.tell(type="restore", edits={"materials.floor.diffuse": 0.2}, view={"layer": "depth"})
    assert dict(shot.window.edits) == {"materials.floor.diffuse": 0.2}
    assert shot.window.now.scene.materials["clay"].exponent == 20
    assert shot.window.layer == "depth"
