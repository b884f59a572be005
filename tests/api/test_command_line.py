"""The functions and the commands do the same: files, reports, messages; and an interrupt leaves nothing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import illumcli
from illumcli.images.reader import read_image

SCENE = """\
version: 1
film: {width: 24, height: 16, samples: 2}
ambient: 0.3
obscurance: {samples: 4}
frames: {last: 2}
cameras: {front: {position: [0, 2, 4]}, side: {position: [4, 2, 0], width: 12}}
materials: {clay: {model: oren_nayar, sigma: {curve: linear, keys: {"0": 0, "2": 0.4}}}}
objects: [{mesh: {shape: torus}, material: clay}, {mesh: m.obj}]
lights: [{light: point, position: [3, 4, 2], intensity: 20}, {light: directional, direction: [0, -1, 0]}]
outputs: {layers: [beauty, obscurance, object_id]}
"""
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1 0\nf 1 2 3\nf 1 1 2\n"
OF_RUN = ("seconds", "total_seconds", "peak_memory_bytes", "written", "content", "body")
OF_MEMORY = ("reused", "skipped", "saved")
"""A loaded scene keeps more, since it does not know what is asked next."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.yaml").write_text(SCENE)
    (tmp_path / "m.obj").write_text(MESH)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "arguments", "options"),
    [
        (["s.yaml", "--frames", "0:2:2"], ["s.yaml"], {"frames": "0:2:2"}),
        (
            ["s.yaml", "--frames", "1:2", "-D", "ambient=frame/9", "--only", "beauty", "--seed", 5],
            ["s.yaml", "ambient=frame/9"],
            {"frames": [1, 2], "layers": "beauty", "seed": 5},
        ),
        (
            ["s.yaml", "--frames", "0:0", "--target-error", 0.2, "--only", "beauty", "--only", "depth"],
            ["s.yaml"],
            {"frames": [0], "target_error": 0.2, "layers": ["beauty", "depth"]},
        ),
        (
            ["s.yaml", "--frames", "0:0", "-D", "obscurance.reconstruct=true"],
            ["s.yaml", {"obscurance.reconstruct": True}],
            {"frames": [0]},
        ),
        (
            ["m.obj", "-D", "film={width: 24, height: 16}", "--view", "90,0", "--up", "z"],
            ["m.obj", {"film": {"width": 24, "height": 16}, "studio.view": [90, 0], "studio.up": "z"}],
            {},
        ),
    ],
    ids=["frames", "formula", "target", "reconstructed", "mesh"],
)
def test_files_and_reports_are_those_of_the_command(illum, folder, words, arguments, options):
    pattern = "{scene}.{camera}.{layer}.{frame}"
    for suffix in ("exr", "png"):
        report = ["--report", f"{suffix}.json", "--no-cache"]
        done = illum("render", *words, "-o", f"cli/{pattern}.{suffix}", *report)
        assert done.returncode == 0, done.stderr
    renderings = illumcli.render(*arguments, cache=False, **options)
    renderings = renderings if isinstance(renderings, list) else [renderings]
    saved = [
        path for each in renderings for end in ("exr", "png") for path in each.save(f"api/{pattern}.{end}")
    ]
    assert sorted(path.name for path in saved) == sorted(os.listdir("cli"))
    for path in saved:
        assert path.read_bytes() == (folder / "cli" / path.name).read_bytes(), path.name

    entries = json.loads((folder / "exr.json").read_text())
    for entry, rendering in zip(entries if isinstance(entries, list) else [entries], renderings, strict=True):
        ours = json.loads(json.dumps(rendering.report))
        left_out = OF_RUN if rendering is renderings[0] else (*OF_RUN, *OF_MEMORY)
        names = [name for name in entry if name not in left_out]
        assert {name: ours[name] for name in names} == {name: entry[name] for name in names}
        assert ours.keys() <= entry.keys()


@pytest.mark.parametrize(
    ("words", "arguments", "options"),
    [
        (["-D", "filmm.width=3", "-D", "ambient=-1"], ["filmm.width=3", "ambient=-1"], {}),
        (["-D", "ambient=-1"], {"ambient": -1}, {}),
        (["--strict"], (), {"strict": True}),
        (["--only", "beuty"], (), {"layers": ["beuty"]}),
        (["-D", "camera.fov=999"], {"camera.fov": 999}, {}),
    ],
)
def test_messages_are_those_of_the_command(illum, words, arguments, options):
    done = illum("render", "s.yaml", "--frames", "0:0", "-o", "{camera}.exr", *words)
    with pytest.raises(illumcli.IllumError) as stop:
        illumcli.render("s.yaml", arguments, frames=[0], **options)
    assert done.returncode == 2
    told = done.stderr.replace("illum: ", "").replace("frame 0: ", "")
    assert all(line in told for line in str(stop.value).splitlines()), done.stderr


def test_a_mesh_is_rendered_like_its_file():
    mesh = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], "faces": [[0, 1, 2], [0, 0, 1]]}
    size = {"film.width": 24, "film.height": 16}
    by_file, by_arrays = (illumcli.render(each, size, cache=False)["beauty"] for each in ("m.obj", mesh))
    assert by_file.any()
    np.testing.assert_array_equal(by_arrays, by_file)


def test_a_sweep_finds_all_faults_before_the_first_ray():
    begun = []
    with pytest.raises(illumcli.IllumError) as stop:
        illumcli.sweep("s.yaml", {"ambient": [0.1, -1, -2]}, progress=lambda *each: begun.append(each))
    assert str(stop.value).splitlines() == [
        "-D ambient=-1: must be at least 0, is -1",
        "-D ambient=-2: must be at least 0, is -2",
    ]
    assert not begun


def test_a_sweep_that_no_memory_holds_is_refused():
    many = {"film": [{"width": 16384, "height": 16384}], "seed": list(range(40))}
    with pytest.raises(illumcli.IllumError, match=r"^40 variants: takes about .* of memory"):
        illumcli.sweep("s.yaml", many)


def test_a_sweep_is_a_table_in_a_notebook():
    table = illumcli.sweep("s.yaml", {"ambient": [0.1, 0.25]}, layers="beauty")
    shown = table._repr_html_()
    assert shown.count("<tr>") == 3
    assert "<td>0.25</td>" in shown


def test_long_tables_are_cut_and_texts_are_escaped():
    from illumcli.api.html_tables import html_table

    shown = html_table([{"name": f"<{k}>"} for k in range(100)])
    assert "&lt;29&gt;" in shown
    assert "&lt;30&gt;" not in shown
    assert "40 more" in shown
    assert "&lt;99&gt;" in shown
    assert html_table([]).startswith("<table>")


@pytest.mark.parametrize("at", [1, 2000])
def test_a_render_that_is_stopped_can_be_repeated(at):
    loaded = illumcli.load("s.yaml")
    size = {"film.width": 200, "film.height": 160}

    def stop(name, done, total):
        if done >= at:
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            loaded.render(size, cache=False, progress=stop)
    again = loaded.render(size, cache=False)
    np.testing.assert_array_equal(again["beauty"], illumcli.render("s.yaml", size, cache=False)["beauty"])


INTERRUPTED = """
import illumcli, signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs of a shell ignore it
loaded = illumcli.load("s.yaml")
size = {"film.width": 500, "film.height": 500, "obscurance.samples": 512}
try:
    loaded.render(size, cache=False, progress=lambda *each: print("going", flush=True))
except KeyboardInterrupt:
    small = {"film.width": 20}
    again, fresh = (each["beauty"] for each in (loaded.render(small), illumcli.render("s.yaml", small)))
    print("stopped", (again == fresh).all())
"""


def test_an_interrupt_stops_a_render_and_leaves_nothing(folder):
    (folder / "tmp").mkdir()
    going = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(folder / "tmp")},
    )
    assert going.stdout is not None
    assert going.stdout.readline() == "going\n"
    time.sleep(0.2)
    going.send_signal(signal.SIGINT)
    told, _ = going.communicate(timeout=60)
    assert told.splitlines()[-1] == "stopped True"
    assert sorted(os.listdir()) == ["m.obj", "s.yaml", "tmp"]
    assert os.listdir("tmp") == []


def test_a_comparison_has_the_pictures_of_the_command(illum, folder):
    one, other = (illumcli.render("s.yaml", {"ambient": each}) for each in (0.1, 0.4))
    for name, rendering in (("a", one), ("b", other)):
        rendering.save(name + "-{camera}.exr")
    done = illum("compare", "a-front.exr", "b-front.exr", "--layer", "beauty", "--heat", "heat.png")
    assert done.returncode == 0, done.stderr
    by_file = illumcli.compare("a-front.exr", "b-front.exr", "beauty")
    channels = read_image(folder / "heat.png").channels
    written = np.stack([channels[name] for name in "RGB"], axis=-1)
    np.testing.assert_array_equal(np.rint(written * 255), by_file.heat())
    assert by_file.flip_map("beauty").mean() == pytest.approx(by_file["beauty"]["flip"], rel=1e-5)
    assert "<td>beauty</td>" in by_file._repr_html_()
    data = illumcli.compare(one, other, ["obscurance"])
    with pytest.raises(illumcli.IllumError, match="layer 'obscurance' has no colours"):
        data.flip_map()
    with pytest.raises(KeyError, match="no layer 'obscurence'; did you mean"):
        data.heat("obscurence")


def test_a_picture_in_8_bits_is_that_of_the_png(folder):
    rendering = illumcli.render("s.yaml", frames=[0])[0]
    rendering.save("{camera}.{layer}.png")
    for layer in ("beauty", "obscurance"):
        channels = read_image(folder / f"front.{layer}.png").channels
        written = np.stack(list(channels.values()), axis=-1)
        np.testing.assert_array_equal(np.rint(written * 255), rendering.display(layer))
    np.testing.assert_array_equal(rendering.display(), rendering.display("beauty"))
