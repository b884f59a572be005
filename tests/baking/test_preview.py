"""`illum ao-bake --preview`: what the picture shows, and when it is kept or refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.baking.bake import bake_mesh
from illumcli.baking.inputs import prepare_bake
from illumcli.baking.preview import SIZE, refuse_preview, with_preview
from illumcli.baking.settings import BakeJob, BakeOptions, BakeSettings
from illumcli.errors import InputError, OutputError
from illumcli.images.contents import image_contents
from illumcli.images.histogram import BAR, histogram_picture
from illumcli.images.reader import read_image

BOX = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4
"""
CORNER = """v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 1 1 0\nv 0 1 0\nv 0 1 1
f 1 4 3 2\nf 1 2 5 6\nf 1 6 7 4
"""
"""A floor and two walls."""
SETTINGS = BakeSettings(samples=16)


def previewed(folder, text, output="box.npz", name="box.obj", settings=SETTINGS, force=False):
    """Bake a mesh with a preview; returns its paths, report and picture."""
    (folder / name).write_text(text)
    job = BakeJob(
        folder / name, (folder / output,), settings, BakeOptions(force=force), folder / "preview.png"
    )
    work = prepare_bake(job)
    refuse_preview(work)
    paths, report = bake_mesh(job.path, job.outputs, settings, job.options)
    paths, report = with_preview(work, paths, report)
    return paths, report, np.stack(list(read_image(folder / "preview.png").channels.values()), axis=-1)


def views(picture, row):
    """The four views of a row, without frames and gaps."""
    first = 30 + row * (SIZE + 8)
    return [picture[first : first + SIZE, 60 + k * (SIZE + 8) :][:, :SIZE] for k in range(4)]


@pytest.mark.parametrize("output", ["box.npz", "box.glb", "box.ply"])
def test_convex_meshes_are_white_from_all_sides(tmp_path, output):
    paths, report, picture = previewed(tmp_path, BOX, output)
    assert [path.name for path in paths] == [output, "preview.png"]
    assert report.written[-1] == str(tmp_path / "preview.png")
    for view in views(picture, 0):
        middle = view[SIZE // 2 - 20 : SIZE // 2 + 20, SIZE // 2 - 20 : SIZE // 2 + 20]
        assert middle.min() == 1


def test_a_corner_is_dark(tmp_path):
    _, _, picture = previewed(tmp_path, CORNER)
    assert views(picture, 0)[0].min() < 0.4


def test_textures_are_shown_on_the_mesh(tmp_path):
    uv = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    faces = "f 1/1 4/2 3/3 2/4\nf 1/1 2/2 5/3 6/4\nf 1/1 6/2 7/3 4/4\n"
    text = CORNER.partition("f ")[0] + uv + faces
    settings = BakeSettings(samples=16, texture=(16, 16))
    _, _, picture = previewed(tmp_path, text, "w.png", settings=settings)
    assert views(picture, 0)[0].min() < 0.6


def test_it_is_kept_with_its_content(tmp_path):
    previewed(tmp_path, BOX)
    before = (tmp_path / "preview.png").read_bytes()
    _, report, _ = previewed(tmp_path, BOX)
    assert report.kept == [str(tmp_path / "box.npz"), str(tmp_path / "preview.png")]
    assert (tmp_path / "preview.png").read_bytes() == before

    # another bake has another preview
    (tmp_path / "box.npz").unlink()
    with pytest.raises(OutputError, match=r"preview\.png"):
        previewed(tmp_path, BOX, settings=BakeSettings(samples=32))
    content = image_contents(tmp_path / "preview.png")
    previewed(tmp_path, BOX, settings=BakeSettings(samples=32), force=True)
    assert image_contents(tmp_path / "preview.png") != content


def test_what_cannot_be_shown_is_refused_before_the_bake(illum_here, tmp_path):
    (tmp_path / "box.obj").write_text(BOX)
    (tmp_path / "s.yaml").write_text("version: 1\nobjects: [{mesh: box.obj}, {mesh: {shape: plane}}]\n")
    for words, told in (
        (("box.obj", "-o", "a.npz", "--preview", "a.svg"), "a.svg"),
        (
            ("s.yaml", "-o", "a.npz", "--preview", "a.png"),
            "a preview shows no scene without its mesh; add a .glb",
        ),
        (
            ("box.obj", "-o", "a.obj", "--color", "r", "--preview", "a.png"),
            "a preview shows no OBJ with --color",
        ),
        (("box.obj", "s.yaml", "-o", "{name}.glb", "--preview", "a.png"), "write {name} into the pattern"),
    ):
        done = illum_here("ao-bake", *words)
        assert (done.returncode, told in done.stderr) == (2, True), done.stderr
    assert not list(tmp_path.glob("*.npz"))

    done = illum_here("ao-bake", "box.obj", "s.yaml", "-o", "{name}.glb", "--preview", "{name}.png", "--json")
    assert [each["files"] for each in json.loads(done.stdout)] == [["box.glb", "box.png"], ["s.glb", "s.png"]]


def test_no_preview_without_obscurance(tmp_path):
    with pytest.raises(InputError, match=r"preview\.png: a preview shows ao; add it to --what"):
        previewed(tmp_path, BOX, settings=BakeSettings(samples=4, what=("bent_normal",)))


def test_histograms_count_by_weight():
    picture = histogram_picture(200, np.array([0.05, 0.55, 1.0]), np.array([1.0, 2.0, 1.0]), "w", bins=10)
    heights = (picture == BAR).all(axis=2).sum(axis=0)
    bars = [heights[round(8 + 17.6 * (k + 0.5))] for k in range(10)]
    assert bars[5] == max(heights) > 0
    assert bars[0] == bars[9] == round(bars[5] / 2)
    assert sum(map(bool, bars)) == 3
