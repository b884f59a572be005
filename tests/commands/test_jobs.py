"""Units of work: descriptions that can be sent to another process, and the class that does them."""

from __future__ import annotations

import pickle
import subprocess
import sys

import pytest

from illumcli.baking.settings import BakeJob, BakeSettings
from illumcli.commands.batch import Batch
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.unit import Worker
from illumcli.errors import IllumError, InputError, LimitError, OutputError

SCENE = """
version: 1
film: {width: 24, height: 16, samples: 2}
ambient: 0.2
objects: [{mesh: {shape: sphere}}]
lights: [{light: directional, name: sun, direction: [-1, -2, -1], irradiance: 2}]
cameras: {left: {position: [-2, 0, 3]}, right: {position: [2, 0, 3]}}
"""
PROCESS = """
import pickle, sys
from illumcli.commands.unit import Worker
worker = Worker()
done = [worker.run(worker.prepare(unit)) for unit in pickle.load(sys.stdin.buffer)]
worker.finish()
sys.stdout.buffer.write(pickle.dumps(done))
"""


@pytest.fixture
def units(tmp_path):
    """A frame of a scene, each of its cameras, two variants, an input of a bake; each with its files."""
    scene, mesh = tmp_path / "s.yaml", tmp_path / "m.obj"
    scene.write_text(SCENE)
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0.2\nf 1 2 3\n")

    def job(pattern, *overrides, **more):
        options = RenderOptions(overrides, str(tmp_path / pattern), seed=3, threads=2)
        return RenderJob(scene, options, **more)

    names = "{camera}-{frame}.exr", "{camera}-{ambient}.png"
    return [
        (job(names[0], fields={"frame": 7}), ["left-0007.exr", "right-0007.exr"]),
        (job(names[0], cameras=("left",)), ["left-0000.exr"]),
        (job(names[0], cameras=("right",)), ["right-0000.exr"]),
        (job(names[1], "ambient=0.4"), ["left-0.4.png", "right-0.4.png"]),
        (job(names[1], "ambient=0.5"), ["left-0.5.png", "right-0.5.png"]),
        (BakeJob(mesh, (tmp_path / "b.npz",), BakeSettings(samples=16)), ["b.npz"]),
    ]


def files(folder):
    return {
        path.name: path.read_bytes() for path in folder.glob("*") if path.suffix in (".exr", ".png", ".npz")
    }


def test_a_unit_is_what_it_was_pickled_as(units):
    for unit, _ in units:
        again = pickle.loads(pickle.dumps(unit))
        assert again == unit
        assert len(pickle.dumps(unit)) < 2000
        assert Worker().prepare(again).content == Worker().prepare(unit).content


def test_another_process_makes_the_same_files_in_any_order(units, tmp_path):
    worker = Worker()
    for unit, names in units:
        paths, _ = worker.run(worker.prepare(unit))
        assert [path.name for path in paths] == names
    own = files(tmp_path)
    assert len(own) == 9
    for name in own:
        (tmp_path / name).unlink()
    done = subprocess.run(
        [sys.executable, "-c", PROCESS],
        input=pickle.dumps([unit for unit, _ in units][::-1]),
        capture_output=True,
        check=True,
    )
    results = pickle.loads(done.stdout)
    assert files(tmp_path) == own
    for (unit, names), (paths, report) in zip(units, results[::-1], strict=True):
        assert [path.name for path in paths] == names
        assert list(report.written) == [str(path) for path in paths]
        assert report.threads == unit.options.threads or unit.options.threads is None


def test_a_unit_that_is_done_is_kept_whoever_did_it(units):
    for unit, _ in units:
        (_, first), (_, second) = run(unit), run(unit)
        assert (list(first.written), list(first.kept)) == (list(second.kept), list(second.written))
        assert first.written


def run(unit):
    worker = Worker()
    return worker.run(worker.prepare(unit))


def failure_of_several():
    batch = Batch("variants", 2, True, lambda text: None)
    with batch.piece(0):
        raise LimitError("too large")
    try:
        batch.finish("and this")
    except IllumError as error:
        return error


@pytest.mark.parametrize(
    "error", [InputError(["a: wrong", "b: wrong"]), OutputError("c: full"), failure_of_several()], ids=type
)
def test_errors_can_be_sent_back(error):
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.exit_code) == (type(error), str(error), error.exit_code)
