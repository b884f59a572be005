"""Sessions without a server: messages in, answers and pictures out."""

from __future__ import annotations

import json
import re
import shlex
import struct
from queue import Queue
from threading import Event, Thread

import pytest

from illumcli.scene.load import load
from illumcli.viewer import session as sessions
from illumcli.viewer import watching
from illumcli.viewer.pictures import Renderer
from illumcli.viewer.quality import Reconstructed
from illumcli.viewer.session import MOST, Session

PATIENCE = 15


class Page:
    """What a page does: it sends messages with stamps, and takes answers and pictures."""

    def __init__(self, renderer):
        self.answers = Queue()
        self.session = Session(renderer, self.answers.put)
        self.thread = Thread(target=self.session.run, daemon=True)
        self.thread.start()
        self.stamp = 0

    def tell(self, **message):
        self.stamp += 1
        self.session.receive(json.dumps({**message, "stamp": self.stamp}))

    def next(self):
        answer = self.answers.get(timeout=PATIENCE)
        if isinstance(answer, str):
            return json.loads(answer)
        (length,) = struct.unpack("<I", answer[:4])
        header = json.loads(answer[4 : 4 + length])
        assert answer[4 + length :].startswith(b"\xff\xd8")  # a JPEG
        return header

    def until(self, **wanted):
        """All answers up to one that has these values; the last one has them."""
        answers = []
        while not (answers and all(answers[-1].get(key) == value for key, value in wanted.items())):
            answers.append(self.next())
        return answers

    def settled(self):
        """All answers up to the full picture of all messages, or that there is nothing new to show."""
        answers = []
        while True:
            answers.append(self.next())
            is_last = answers[-1]["type"] == "same" or answers[-1].get("stage") == "full"
            if is_last and (answers[-1]["stamp"] or 0) >= self.stamp:
                return answers

    def close(self):
        self.session.close()
        self.thread.join(timeout=PATIENCE)
        assert not self.thread.is_alive()


@pytest.fixture
def opened():
    """Opens pages, and closes them."""
    pages = []

    def open_page(renderer):
        pages.append(Page(renderer))
        return pages[-1]

    yield open_page
    for page in pages:
        page.close()


@pytest.fixture
def page(opened, scene):
    """A page whose first full picture is there."""
    page = opened(Renderer(scene, threads=1))
    page.settled()
    return page


def types(answers):
    return [answer.get("stage", answer["type"]) for answer in answers]


def pictures(answers):
    return [answer for answer in answers if answer["type"] == "picture"]


def test_a_window_begins_with_the_scene_and_its_first_layer(opened, scene):
    scene.write_text(scene.read_text() + "outputs: {layers: [normal, depth]}\n")
    answers = opened(Renderer(scene, threads=1)).settled()
    assert types(answers)[0] == "scene"
    assert answers[0]["view"] == {
        "camera": "main", "layer": "normal", "exposure": 0.0, "width": 96, "height": 54, "hidden_lights": [],
    }  # fmt: skip
    assert answers[0]["materials"][0] == {"name": "clay", "model": "phong", "objects": ["ball"]}
    assert {"name": "fill", "kind": "point"} in answers[0]["lights"]
    assert {"name": "ward"}.items() <= next(m for m in answers[0]["models"] if m["name"] == "ward").items()
    names = [layer["name"] for layer in answers[0]["layers"]]
    assert {"beauty", "depth", "key", "shadow.fill"} <= set(names)
    assert "materials.clay.exponent" in [control["path"] for control in answers[0]["controls"]]
    assert answers[0]["film"] == [96, 54]
    assert types(pictures(answers))[0] == "coarse"
    assert {picture["layer"] for picture in pictures(answers)} == {"normal"}


def test_a_material_costs_no_ray_and_comes_with_the_newest_stamp(page):
    page.tell(type="set", path="materials.clay.diffuse", value=[0.1, 0.2, 0.3])
    answers = page.settled()
    assert types(answers) == ["values", "coarse", "full"]
    assert answers[0] == {
        "type": "values", "values": {}, "edits": {"materials.clay.diffuse": [0.1, 0.2, 0.3]},
    }  # fmt: skip
    assert [picture["rays"] for picture in pictures(answers)] == [0, 0]
    assert {picture["stamp"] for picture in pictures(answers)} == {1}


def test_what_changes_nothing_is_answered_too(page):
    page.tell(type="set", path="materials.clay.exponent", value=20)
    assert types(page.settled())[-1] == "same"
    page.tell(type="view", layer="beauty", hidden_lights=[])
    assert types(page.settled()) == ["same"]
    page.tell(type="move", orbit=[0, 0], dragging=False)
    assert types(page.settled())[-1] == "same"


def test_a_refused_value_is_told_with_its_place_and_the_one_in_force(page):
    page.tell(type="set", path="camera.fov", value=500)
    problem, values, _ = page.settled()
    assert problem["type"] == "problem"
    assert problem["from"] == "edit"
    assert problem["lines"] == ["-D camera.fov=500: must be below 180, is 500"]
    assert values["values"] == {"camera.fov": 35.0}
    assert values["edits"] == {}
    page.tell(type="set", path="camera.fov", value=50)
    assert types(page.settled()) == ["values", "coarse", "solved", "full"]


def test_a_switch_of_the_model_brings_other_controls(page):
    page.tell(type="set", path="materials.clay.model", value="ward")
    answers = page.settled()
    assert types(answers)[0] == "scene"
    paths = [control["path"] for control in answers[0]["controls"]]
    assert "materials.clay.alpha_x" in paths
    assert "materials.clay.exponent" not in paths
    assert {picture["rays"] for picture in pictures(answers)} == {0}
    page.tell(type="reset")
    answers = page.settled()
    assert types(answers)[0] == "scene"
    assert answers[0]["edits"] == {}


def test_all_motions_count_though_pictures_are_skipped(page, scene):
    for _ in range(50):
        page.tell(type="move", orbit=[0.01, 0], dragging=True)
    page.tell(type="move", orbit=[0, 0], dragging=False)
    answers = page.settled()
    (values,) = (answer for answer in answers if answer["type"] == "values")
    x, _, z = values["values"]["camera.position"]
    assert x == pytest.approx(-4, abs=0.01)  # half a turn of half a turn
    assert z == pytest.approx(0, abs=0.01)
    assert len(pictures(answers)) < 40


def test_a_drag_is_shown_coarse_and_rests_full(page):
    page.tell(type="set", path="lights.key.position", value=[-2, 5, 3], dragging=True)
    answers = page.settled()
    assert types(answers) == ["coarse", "full"]
    page.tell(type="set", path="lights.key.position", value=[-2, 5, 3], dragging=False)
    assert types(page.settled()) == ["values", "same"]


def test_values_under_the_mouse(page):
    page.tell(type="pick", x=0.5, y=0.5)
    (pixel,) = page.until(type="pixel")
    assert (pixel["object"], pixel["material"], pixel["stamp"]) == ("ball", "clay", 1)
    assert (pixel["x"], pixel["y"]) == (48, 27)
    assert pixel["layers"]["object_id"] == {"Y": 1}
    assert set(pixel["layers"]["beauty"]) == {"R", "G", "B"}
    page.tell(type="pick", x=1.0, y=0)
    (pixel,) = page.until(type="pixel")
    assert (pixel["x"], pixel["y"]) == (95, 0)
    assert (pixel["object"], pixel["material"]) == (None, None)


@pytest.mark.parametrize(
    "text", ["", "nonsense", "[1]", "{}", '{"type": "dance"}', '{"type": "set", "path": "materials.clay"}',
             '{"type": ["set"]}', '{"type": "move", "orbit": "left"}',
             '{"type": "set", "path": {}, "value": 1}', '{"type": "restore"}',
             '{"type": "view", "width": 3}', '{"type": "pick", "x": "left", "y": 0}',
             '{"type": "move", "orbit": [NaN, 0]}', '{"type": "set", "path": "camera.fov", "value": NaN}',
             '{"type": "set", "path": "", "value": 1}', '{"type": "view", "width": 1e999, "height": 3}',
             '{"type": "pick", "x": -Infinity, "y": 0}',
             '{"type": "lobes", "of": ["clay"], "theta": 0, "phi": 0}',
             '{"type": "lobes", "of": [{"model": "phong"}], "theta": 0, "phi": Infinity}',
             '{"type": "lobes", "of": [{"model": "phong"}], "theta": NaN, "phi": 0}',
             pytest.param(json.dumps({"type": "lobes", "of": [{}] * 99, "theta": 0, "phi": 0}), id="many"),
             '{"type": "set", "path": "ambient.color.0.1.2", "value": 5}',
             pytest.param("[" * 100000, id="deep"),
             pytest.param(f'{{"type": "view", "layer": {"[" * 900}{"]" * 900}}}', id="deep layer"),
             pytest.param(f'{{"type": "set", "path": "seed", "value": {"[" * 900}{"]" * 900}}}', id="deeper"),
             pytest.param(f'{{"type": "view", "exposure": {"9" * 4000}}}', id="long number")],
)  # fmt: skip
def test_messages_that_make_no_sense_are_told_and_change_nothing(page, text):
    page.session.receive(text)
    assert page.until(type="problem")[-1]["from"] == "edit"
    page.tell(type="view", layer="beauty")
    assert types(page.settled())[-1] == "same"


def test_a_picture_in_progress_gives_way_to_a_newer_message(opened, scene):
    begun = Event()

    class Slow(Renderer):
        """Full pictures take for ever, until someone stops them."""

        def picture(self, window, coarse, progress):
            while coarse is None and "materials.clay.exponent" not in window.edits:
                begun.set()
                progress("main", 0, 1)
            return super().picture(window, coarse, progress)

    page = opened(Slow(scene, threads=1))
    assert begun.wait(PATIENCE)
    page.tell(type="pick", x=0.5, y=0.5)  # is answered meanwhile
    assert types(page.until(type="pixel")).count("full") == 0
    page.tell(type="set", path="materials.clay.exponent", value=5)
    answers = page.settled()
    assert types(answers).count("full") == 1
    assert answers[-1]["stamp"] == 2


@pytest.fixture
def _slow(monkeypatch):
    """All obscurance rays take long."""
    monkeypatch.setattr(sessions, "LONG", 0.0)


FEW = "film.samples=4"  # so that one ray of each sample is few


@pytest.mark.usefixtures("_slow")
def test_what_takes_long_is_reconstructed_before(opened, scene):
    page = opened(Renderer(scene, [FEW], threads=1))
    *_, middle, full = pictures(page.settled())
    assert (middle["stage"], full["stage"]) == ("reconstructed", "full")
    assert (middle["width"], middle["height"]) == (96, 54)
    assert middle["error"] > 0
    stated = {"stage": "reconstructed", "error": middle["error"], "is_earlier": False}
    assert middle["stated"] == full["stated"] == stated
    assert full["error"] is None

    # The obscurance of these is known.
    page.tell(type="set", path="materials.clay.diffuse", value=[0.1, 0.2, 0.3])
    answers = page.settled()
    assert types(answers) == ["values", "coarse", "full"]
    assert [picture["stated"] for picture in pictures(answers)] == [stated | {"is_earlier": True}] * 2
    page.tell(type="set", path="lights.key.position", value=[-2, 5, 3])
    assert "reconstructed" not in types(page.settled())

    # An error is that of one layer.
    page.tell(type="view", layer="normal")
    answers = pictures(page.settled())
    assert types(answers)[-2:] == ["coarse", "full"]
    assert [picture["stated"] for picture in answers] == [None] * len(answers)

    page.tell(type="move", orbit=[0.1, 0])
    page.tell(type="view", layer="beauty")
    last = pictures(page.settled())
    assert types(last)[-2:] == ["reconstructed", "full"]
    assert last[-1]["stated"] == {**stated, "error": last[-2]["error"]}


@pytest.mark.parametrize("given", ["obscurance.samples=1", "obscurance.reconstruct=true", "obscurance=null"])
@pytest.mark.usefixtures("_slow")
def test_what_has_few_rays_or_is_reconstructed_already_has_no_stage_between(opened, scene, given):
    page = opened(Renderer(scene, [FEW, given], threads=1))
    full = page.settled()[-1]
    page.tell(type="move", orbit=[0.1, 0])
    assert "reconstructed" not in types(page.settled())
    if full["error"] is not None:
        assert full["stated"] == {"stage": "full", "error": full["error"], "is_earlier": False}


def test_long_is_many_rays_at_the_speed_of_the_last_ones(opened, scene):
    class Many(Renderer):
        def obscurance_rays(self, window):
            return 10**9 if "materials.clay.exponent" in window.edits else 1

    page = opened(Many(scene, [FEW], threads=1))
    assert "reconstructed" not in types(page.settled())
    page.tell(type="set", path="materials.clay.exponent", value=5)
    assert "reconstructed" in types(page.settled())


def test_what_takes_no_time_has_no_stage_between(opened, scene):
    assert "reconstructed" not in types(opened(Renderer(scene, [FEW], threads=1)).settled())


@pytest.mark.usefixtures("_slow")
def test_a_reconstructed_picture_in_progress_gives_way_too(opened, scene):
    begun = Event()

    class Slow(Renderer):
        def picture(self, window, quality, progress):
            while isinstance(quality, Reconstructed) and not window.edits:
                begun.set()
                progress("main", 0, 1)
            return super().picture(window, quality, progress)

    page = opened(Slow(scene, [FEW], threads=1))
    assert begun.wait(PATIENCE)
    page.tell(type="set", path="materials.clay.exponent", value=5)
    answers = types(page.settled())
    assert answers.count("full") == answers.count("reconstructed") == 1


def test_a_closed_window_ends_at_once(opened, scene):
    begun = Event()

    class Slow(Renderer):
        def picture(self, window, coarse, progress):
            while True:
                begun.set()
                progress("main", 0, 1)

    page = opened(Slow(scene))
    assert begun.wait(PATIENCE)
    page.close()


def test_windows_do_not_know_of_each_other(opened, scene):
    first, second = opened(Renderer(scene, threads=1)), opened(Renderer(scene, threads=1))
    first.settled()
    second.settled()
    first.tell(type="set", path="materials.clay.exponent", value=5)
    first.settled()
    second.tell(type="set", path="materials.floor.diffuse", value=0.1)
    assert second.settled()[0]["edits"] == {"materials.floor.diffuse": 0.1}
    assert first.answers.empty()


@pytest.fixture
def _soon(monkeypatch):
    """Changes of files are seen soon."""
    monkeypatch.setattr(watching, "PERIOD", 0.02)


@pytest.mark.usefixtures("_soon")
def test_a_mistake_in_the_file_is_told_and_the_picture_stays_until_it_is_mended(page, scene):
    text = scene.read_text()
    page.tell(type="set", path="materials.clay.exponent", value=5)
    page.settled()
    scene.write_text(text.replace("model: phong", "model: phng"))
    (problem,) = page.until(type="problem")
    assert problem["from"] == "file"
    assert problem["lines"] == [f"{scene}:7:10: materials.clay.model: no model 'phng'; did you mean 'phong'?"]
    page.tell(type="set", path="materials.floor.diffuse", value=0.1)  # still possible, and solves nothing
    assert types(page.settled()) == ["values", "coarse", "full"]
    scene.write_text(text.replace("[0.6, 0.2, 0.1]", "[0.1, 0.2, 0.6]"))
    answers = page.until(stage="full")
    assert types(answers) == ["scene", "coarse", "solved", "full"]
    assert answers[0]["edits"] == {"materials.clay.exponent": 5, "materials.floor.diffuse": 0.1}
    assert {picture["rays"] for picture in pictures(answers)} == {0}


@pytest.mark.usefixtures("_soon")
def test_meshes_textures_and_extended_scenes_are_watched(opened, scene, tmp_path):
    (tmp_path / "mesh.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0.2\nusemtl red\nf 1 2 3\n")
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0 0\n")
    child = tmp_path / "child.yaml"
    mesh = "{mesh: {file: mesh.obj, materials: true}}"
    child.write_text(f"extends: ball.yaml\nobjects: [{mesh}]\nmaterials: {{clay: {{exponent: 3}}}}\n")
    page = opened(Renderer(child, threads=1))
    page.settled()
    for path, old, new in (
        (scene, "[0.6, 0.2, 0.1]", "[0.1, 0.2, 0.6]"),
        (tmp_path / "mesh.obj", "v 1 0 0", "v 2 0 0"),
        (tmp_path / "m.mtl", "Kd 1", "Kd 0.5"),
    ):
        path.write_text(path.read_text().replace(old, new))
        assert types(page.until(stage="full"))[0] == "scene", path
    page.tell(type="set", path="materials.clay.exponent", value=5)
    page.settled()
    (tmp_path / "mesh.obj").write_text("v 0 0\n")
    (problem,) = (answer for answer in page.until(type="problem") if answer["type"] == "problem")
    assert "mesh.obj" in problem["lines"][0]
    assert problem["from"] == "file"
    (tmp_path / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0.2\nf 1 2 3\n")
    assert "solved" in types(page.until(stage="full"))


@pytest.mark.usefixtures("_soon")
def test_a_scene_that_is_faulty_from_the_beginning_shows_once_it_is_mended(opened, scene):
    text = scene.read_text()
    scene.write_text(text.replace("version: 1", "version: 7"))
    page = opened(Renderer(scene, threads=1))
    (problem,) = page.until(type="problem")
    assert problem["lines"][0].startswith(f"{scene}:1:")
    page.tell(type="view", layer="depth")
    scene.write_text(text)
    assert types(page.until(stage="full"))[0] == "scene"


def test_a_flood_of_messages_waits_outside(scene):
    session = Session(Renderer(scene, threads=1), Queue().put)

    def flood():
        for _ in range(MOST + 10):
            session.receive('{"type": "pick", "x": 0, "y": 0}')

    thread = Thread(target=flood, daemon=True)
    thread.start()
    while len(session._pending) < MOST:
        assert thread.is_alive()
    thread.join(timeout=0.1)
    assert (thread.is_alive(), len(session._pending)) == (True, MOST)
    session.close()
    thread.join(timeout=PATIENCE)
    assert not thread.is_alive()


def test_a_machine_that_has_no_memory_to_read_the_scene_may_have_it_later(opened, scene, monkeypatch):
    monkeypatch.setattr(watching, "PERIOD", 0.02)

    class Tight(Renderer):
        def read(self):
            loaded = super().read()
            if "version: 1 " in scene.read_text():
                raise MemoryError
            return loaded

    page = opened(Tight(scene, threads=1))
    page.settled()
    text = scene.read_text()
    scene.write_text(text.replace("version: 1", "version: 1 "))
    (problem,) = page.until(type="problem")
    assert (problem["from"], problem["lines"][0][:13]) == ("file", "out of memory")
    scene.write_text(text)
    assert "solved" in types(page.until(stage="full"))


def test_the_panel_of_brdfs_is_answered_with_its_own_stamp(page):
    page.tell(type="lobes", of=[{"material": "clay"}, {"model": "merl"}], theta=30, phi=0)
    answer = page.next()
    assert (answer["type"], answer["stamp"]) == ("lobes", 1)
    assert [each["label"] for each in answer["lobes"]] == ["clay", "merl"]
    assert "problem" in answer["lobes"][1]
    page.tell(type="set", path="materials.clay.model", value="lambert")
    page.settled()
    page.tell(type="lobes", of=[{"material": "clay"}], theta=30, phi=0)
    assert page.next()["lobes"][0]["title"] == "Lambert"


def test_the_command_renders_the_picture(opened, scene, illum, tmp_path):
    page = opened(Renderer(scene, ["film.samples=2"], threads=1))
    page.settled()
    page.tell(type="set", path="materials.clay.model", value="ward")
    page.tell(type="view", layer="normal", exposure=1.5, width=40, height=30, hidden_lights=["fill"])
    page.settled()
    page.tell(type="command")
    words = shlex.split(page.next()["text"])
    assert words[:5] == ["illum", "render", str(scene), "-D", "film.samples=2"]
    assert words[-2:] == ["--only", "normal"]
    done = illum(*words[1:], "-o", "picture.png")
    assert done.returncode == 0, done.stderr
    width, height = struct.unpack(">II", (tmp_path / "picture.png").read_bytes()[16:24])
    assert (width, height) == (40, 30)


def test_the_command_renders_no_other_camera_or_frame(opened, scene, illum, tmp_path):
    cameras = "cameras: {near: {fov: 20}, far: {fov: 60}}\nframes: {first: 3, last: 9}"
    scene.write_text(re.sub("camera:.*", cameras, scene.read_text()))
    page = opened(Renderer(scene, threads=1))
    page.settled()
    page.tell(type="view", camera="far", exposure=0, width=96, height=54)
    page.settled()
    page.tell(type="command")
    words = shlex.split(page.next()["text"])
    assert words == ["illum", "render", str(scene), "-D", "cameras.near=null", "--frames", "3:3"]
    done = illum(*words[1:], "-o", "{camera}.{frame}.png")
    assert (done.returncode, done.stdout.split()) == (0, ["far.0003.png"])


def test_edits_are_saved_as_a_scene(page, scene):
    target = scene.with_name("new.yaml")
    page.tell(type="set", path="materials.clay.exponent", value=50)
    page.settled()
    page.tell(type="save", file=str(target))
    assert page.next() == {"type": "saved", "file": str(target), "stamp": 2}
    assert load(target).scene.materials["clay"].exponent == 50

    page.tell(type="reset")
    page.settled()
    page.tell(type="save", file=str(target))
    problem = page.next()
    assert (problem["type"], problem["from"]) == ("problem", "save")
    assert "a different file is there" in problem["lines"][0]
    page.next()
    page.tell(type="save", file=str(target), replace=True)
    assert page.next()["type"] == "saved"
    assert load(target).scene == load(scene).scene


def test_a_page_that_is_open_to_others_saves_beside_the_scene_alone(opened, scene, tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "link.yaml").symlink_to(tmp_path.parent / "linked.yaml")
    page = opened(Renderer(scene, threads=1, saves_anywhere=False))
    page.settled()
    page.tell(type="save", file=str(tmp_path / "deep" / "new.yaml"))
    assert page.next()["type"] == "saved"
    for target in ("../new.yaml", "deep/../../new.yaml", "link.yaml"):
        page.tell(type="save", file=str(tmp_path / target), replace=True)
        problem = page.until(type="problem")[-1]
        assert problem["from"] == "save"
        assert f"saves in {tmp_path} or below alone" in problem["lines"][0]
    assert not (tmp_path.parent / "new.yaml").exists()
    assert not (tmp_path.parent / "linked.yaml").exists()


def test_a_name_that_the_disk_refuses_is_told(page):
    page.tell(type="save", file=f"{'long' * 500}.yaml")
    problem = page.next()
    assert (problem["type"], problem["from"]) == ("problem", "save")
    assert "name too long" in problem["lines"][0]


def test_an_edit_that_only_a_render_can_refuse_is_not_blamed_on_the_file(page):
    page.tell(type="set", path="materials.clay.diffuse", value="{vertex: no_such}")
    (problem,) = (answer for answer in page.until(type="problem") if answer["type"] == "problem")
    assert problem["from"] == "edit"
    assert "no_such" in problem["lines"][0]
