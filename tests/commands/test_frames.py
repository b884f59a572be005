"""Films: frames of renders and sweeps, their names and faults; overrides of their values give the same."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from illumcli.cluster.inputs import Inputs
from illumcli.commands.film_command import film_command
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.images.reader import read_image

SCENE = """version: 1
frames: {last: 3, fps: 2}
film: {width: 24, height: 16, samples: 2}
ambient: {curve: linear, keys: {0: 0.1, 3: 0.7}}
obscurance: {samples: 4}
materials:
  clay: {model: phong, diffuse: {curve: smooth, keys: {0: "#cc2200", 3: [0.1, 0.2, 0.7]}}}
objects:
  - {name: thing, mesh: {curve: step, keys: {0: {shape: sphere}, 2: {shape: box}}}, material: clay}
  - {mesh: {shape: disc, radius: 4}}
lights:
  - {light: point, position: {curve: formula, value: [3*cos(pi*time), 3, 3*sin(pi*time)]}, intensity: 20}
"""
MESH = "v 0 0 0\nv 1 0 {0}\nv 0 1 0.2\nv 0.4 0.3 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


@pytest.fixture
def film(tmp_path):
    (tmp_path / "film.yaml").write_text(SCENE)
    return tmp_path


def written(done):
    return done.stdout.split()


def test_a_render_has_all_frames_and_those_that_are_asked_for(illum, film):
    done = illum("render", "film.yaml")
    assert written(done) == [f"film.main.{number:04d}.png" for number in range(4)], done.stderr
    some = illum("render", "film.yaml", "--frames", "1:9:4", "-o", "{scene}-{frame:02d}.exr")
    assert written(some) == ["film-01.exr", "film-05.exr", "film-09.exr"], some.stderr
    single = illum("render", "film.yaml", "--frames", "2:2", "-o", "2.png")
    assert (film / "2.png").read_bytes() == (film / "film.main.0002.png").read_bytes(), single.stderr


@pytest.mark.parametrize("packets", ["1", "0"])
def test_frames_are_bit_for_bit_the_scene_with_their_values(illum, film, packets):
    done = illum("render", "film.yaml", "--frames", "1:2", "-o", "film{frame:d}.exr", ILLUM_PACKETS=packets)
    assert done.returncode == 0, done.stderr
    (film / "still.yaml").write_text(SCENE.replace("frames: {last: 3, fps: 2}\n", ""))
    values = [
        ("0.3", "[0.472152150321, 0.0645297119634, 0.181481481481]", "sphere", "[0, 3, 3]"),
        ("0.5", "[0.2, 0.1, 0.4]", "box", "[-3, 3, 0]"),
    ]
    from illumcli.scene.animation import overrides_of_frame
    from illumcli.scene.load import load

    for number, _ in enumerate(values, 1):
        given = overrides_of_frame(load(film / "film.yaml", frame=number))
        assert {text.partition("=")[0] for text in given} == {
            "ambient", "materials.clay.diffuse", "objects.0.mesh", "lights.0.position"
        }  # fmt: skip
        words = [word for text in given for word in ("-D", text)]
        still = illum("render", "still.yaml", *words, "--no-cache", "-o", f"still{number}.exr")
        assert still.returncode == 0, still.stderr
        assert (film / f"still{number}.exr").read_bytes() == (film / f"film{number}.exr").read_bytes()


def test_what_a_frame_does_not_change_is_not_computed_again(illum, film):
    text = SCENE.replace("{curve: step, keys: {0: {shape: sphere}, 2: {shape: box}}}", "{shape: sphere}")
    (film / "film.yaml").write_text(text)
    done = illum("render", "film.yaml", "--report", "r.json", "--no-cache")
    entries = json.loads((film / "r.json").read_text())
    assert [entry["frame"] for entry in entries] == [0, 1, 2, 3], done.stderr
    assert set(entries[0]["rays"]) == {"hits", "shadow:point1", "obscurance"}
    for entry in entries[1:]:
        assert set(entry["rays"]) == {"shadow:point1"}  # the light moves
        assert entry["reused"]["main"]["obscurance"] == "memory"
    plan = illum("plan", "film.yaml", "--json")
    (part,) = json.loads(plan.stdout)
    different = part["variants"]["times"]
    assert part["variants"]["labels"] == ["frame 0", "frame 1", "frame 2", "frame 3"]
    assert (different["hits"], different["obscurance"], different["shadow:point1"]) == (1, 1, 4)
    table = illum("plan", "film.yaml", "--frames", "0:3:3").stdout
    assert "all     2 variants from frame 0 to frame 3" in table


def test_sweeps_have_every_variant_at_every_frame(illum, film):
    done = illum(
        "sweep", "film.yaml", "-D", "objects.1.mesh.radius=1,4", "--frames", "0:2:2", "--table", "t.csv"
    )
    assert written(done) == [f"film-{radius}.{frame:04d}.png" for radius in (1, 4) for frame in (0, 2)], (
        done.stderr
    )
    lines = (film / "t.csv").read_text().splitlines()
    assert [line.split(",")[1:3] for line in lines[1:]] == [["0", "1"], ["2", "1"], ["0", "4"], ["2", "4"]]
    (film / "rows.csv").write_text("film.exposure\n0\n1\n")
    words = ("--rows", "rows.csv", "--zip", "-D", "film.samples=1,2", "-D", "objects.1.mesh.radius=1,4")
    done = illum("sweep", "film.yaml", *words, "--frames", "0:1", "--sheet", "s.png")
    assert len(written(done)) == 2 * 2 * 2, done.stderr
    assert written(done)[:2] == ["film-0-1-1.0000.png", "film-0-1-1.0001.png"]
    alone = illum("render", "film.yaml", "--frames", "1:1", "-D", "objects.1.mesh.radius=1", "-o", "a.png",
                  "-D", "film.samples=1")  # fmt: skip
    assert (film / "a.png").read_bytes() == (film / "film-0-1-1.0001.png").read_bytes(), alone.stderr


def test_formulas_of_overrides(illum, film):
    still = SCENE.replace("frames: {last: 3, fps: 2}\n", "").partition("lights:")[0]
    (film / "still.yaml").write_text(
        still.replace("{curve: step, keys: {0: {shape: sphere}, 2: {shape: box}}}", "{shape: sphere}")
    )
    told = illum("render", "still.yaml")
    assert told.returncode == 2
    assert (
        "still.yaml:3:1: ambient: varies with the frame, and there are no frames; add frames: {last: 47}"
        in told.stderr
    )
    words = ("-D", "ambient=time*6", "-D", "materials.clay.diffuse=[0.1*frame, 0.2, 0.3]", "--frames", "1:2")
    done = illum("render", "still.yaml", *words, "-o", "{frame:d}-{ambient}.png")
    assert written(done) == ["1-0.25.png", "2-0.5.png"], done.stderr
    swept = illum("sweep", "still.yaml", *words, "-o", "s{frame:d}.png")
    assert written(swept) == ["s1.png", "s2.png"], swept.stderr
    assert (film / "s2.png").read_bytes() == (film / "2-0.5.png").read_bytes()


def test_parts_of_a_scene_that_come_and_go(illum, film):
    (film / "odd.yaml").write_text("""version: 1
frames: {last: 2}
film: {width: 16, height: 9, samples: 1}
ambient: 0.5
obscurance: {curve: step, keys: {0: null, 2: {samples: 4}}}
objects:
  curve: step
  keys: {0: [{mesh: {shape: sphere}}], 2: [{mesh: {curve: step, keys: {0: {shape: box}}}}]}
lights:
  - curve: step
    keys: {0: {light: directional, direction: [0, -1, 0]}, 1: {light: point, position: [0, 3, 0]}}
""")
    done = illum("render", "odd.yaml", "--report", "r.json")
    assert len(written(done)) == 3, done.stderr
    rays = [set(entry["rays"]) for entry in json.loads((film / "r.json").read_text())]
    assert rays == [
        {"hits", "shadow:directional1"}, {"shadow:point1"}, {"hits", "obscurance", "shadow:point1"}
    ]  # fmt: skip
    many = illum("render", "odd.yaml", "--frames", f"0:{2**53 - 1}")
    assert many.returncode == 2
    assert "frames are more than 100000; render them in parts" in many.stderr


def test_a_turntable_of_a_mesh(illum, film):
    (film / "m.obj").write_text(MESH.format(0))
    words = ("-D", "studio.view=[10*frame, 20]", "-D", "film={width: 16, height: 9, samples: 1}")
    done = illum("render", "m.obj", *words, "--frames", "0:9:9")
    assert written(done) == ["m.0000.png", "m.0009.png"], done.stderr
    illum("render", "m.obj", "--view", "90,20", *words[2:], "-o", "side.png")
    assert (film / "side.png").read_bytes() == (film / "m.0009.png").read_bytes()


def test_a_fault_of_frames_is_told_once_and_the_others_are_rendered(illum, film):
    words = ("film.yaml", "-D", "ambient.keys.3=-0.5", "-D", "seed=7")
    done = illum("render", *words)
    assert (done.returncode, written(done)) == (2, ["film.main.0000.png"])
    first, summary = done.stderr.splitlines()
    assert first == "-D ambient.keys.3=-0.5: ambient: at frame 1: must be at least 0, is -0.1"
    assert summary == "3 of 4 frames failed"
    checked = illum("check", *words)
    assert "at 3 frames from 1 to 3: must be at least 0" in checked.stderr
    assert illum("check", "film.yaml").stdout == "film.yaml: ok\n"
    stopped = illum("render", *words, "--stop-at-first", "--force")
    assert (stopped.returncode, stopped.stdout) == (2, "film.main.0000.png\n")


@pytest.mark.parametrize("command", ["render", "sweep"])
def test_frames_where_a_formula_has_no_value_fail_alone(illum, film, command):
    done = illum(command, "film.yaml", "-D", "seed=1/abs(frame-1)", "--frames", "0:2", "-o", "{frame:d}.png")
    assert (done.returncode, written(done)) == (2, ["0.png", "2.png"])
    fault, summary = done.stderr.splitlines()
    assert fault.endswith("at frame 1: '1/abs(frame-1)' is not a finite number")
    assert summary.startswith("1 of 3 ")


def test_files_of_a_sequence(illum, film):
    for number in (1, 2):
        (film / f"mesh.{number:03d}.obj").write_text(MESH.format(number / 3))
    text = SCENE.replace("{curve: step, keys: {0: {shape: sphere}, 2: {shape: box}}}", "mesh.###.obj")
    (film / "film.yaml").write_text(text)
    done = illum("render", "film.yaml", "--frames", "1:3")
    assert written(done) == ["film.main.0001.png", "film.main.0002.png"]
    assert "film.yaml:9:25: objects.0.mesh: no file mesh.003.obj; did you mean 'mesh.002.obj'?" in done.stderr
    checked = illum("check", "film.yaml", "--frames", "1:3")
    assert checked.returncode == 2
    assert "no file mesh.003.obj" in checked.stderr
    cycle = "{file: {curve: sequence, file: mesh.###.obj, number: 'mod(frame, 2) + 1'}}"
    (film / "film.yaml").write_text(text.replace("mesh.###.obj", cycle))
    assert illum("check", "film.yaml").returncode == 0
    cached = illum("render", "film.yaml", "-o", "c{frame}.exr")
    assert cached.returncode == 0, cached.stderr
    plan = json.loads(illum("plan", "film.yaml", "--json").stdout)[0]["variants"]["times"]
    assert plan["geometry"] == 2


def test_workers_elsewhere_get_the_files_of_a_frame(film):
    for name in ("m.0.obj", "m.1.obj", "t.csv"):
        (film / name).write_text(MESH.format(0))
    text = SCENE.replace("{curve: step, keys: {0: {shape: sphere}, 2: {shape: box}}}", "m.#.obj")
    (film / "film.yaml").write_text(text)
    (film / "t.csv").write_text("x\n1\n2\n")
    curve = f"film.exposure={{curve: column, file: {film / 't.csv'}, column: x}}"
    unit = RenderJob(film / "film.yaml", RenderOptions((curve,)), 1)
    assert {path.name for path in Inputs().of_all([unit])} == {"film.yaml", "m.1.obj", "t.csv"}


def test_several_scenes_of_which_one_is_a_film(illum, film):
    (film / "a.yaml").write_text("version: 1\nobjects: [{mesh: {shape: box}}]\nambient: 1\n")
    done = illum("render", "a.yaml", "film.yaml", "-D", "film={width: 8, height: 8}", "--report", "r.json")
    assert written(done) == ["a.main.png", *(f"film.main.{number:04d}.png" for number in range(4))]
    entries = json.loads((film / "r.json").read_text())
    assert [entry.get("frame") for entry in entries] == [None, 0, 1, 2, 3]
    same = illum("render", "film.yaml", "-o", "film.png")
    assert same.returncode == 2
    assert "film.png: the name of 4 images" in same.stderr


def test_a_target_error_holds_at_the_frame(illum, film):
    done = illum("render", "film.yaml", "--frames", "2:2", "--target-error", "0.05", "-o", "t.exr", "-v")
    assert done.returncode == 0, done.stderr
    words = next(line for line in done.stderr.splitlines() if "for an error" in line)
    overrides = [text for text in words.partition(", for")[0].split() if "=" in text]
    given = [word for text in overrides for word in ("-D", text)]
    again = illum("render", "film.yaml", "--frames", "2:2", *given, "-o", "u.exr")
    assert again.returncode == 0, again.stderr
    chosen, same = (read_image(film / name).channels for name in ("t.exr", "u.exr"))
    assert all(np.array_equal(chosen[name], same[name]) for name in chosen)


@pytest.mark.parametrize(
    ("names", "first", "command"),
    [
        (("a.main.0000.png", "a.main.0001.png"), 0, "-i a.main.%04d.png {} a.main.mp4"),
        (("4/a4-4.png", "4/a4-5.png"), 4, "-start_number 4 -i 4/a4-%01d.png {} 4/a4.mp4"),
        (("09.png", "10.png"), 9, "-start_number 9 -i %02d.png {} film.mp4"),
        (("5%/09 b.png", "5%/10 b.png"), 9, "-start_number 9 -i '5%%/%02d b.png' {} '5%/ b.mp4'"),
    ],
)
def test_the_command_of_the_film(names, first, command):
    made = film_command([(first + k, Path(name)) for k, name in enumerate(names)], 25)
    even = "-vf 'pad=ceil(iw/2)*2:ceil(ih/2)*2' -pix_fmt yuv420p"
    assert made == f"ffmpeg -framerate 25 {command.format(even)}"


def test_what_makes_no_film_has_no_command():
    assert film_command([(0, Path("a0.png"))], 24) is None
    assert film_command([(0, Path("a0.png")), (2, Path("a2.png"))], 24) is None
    assert film_command([(0, Path("a0.exr")), (1, Path("a1.exr"))], 24) is None
    assert film_command([(0, Path("a.png")), (1, Path("b.png"))], 24) is None
