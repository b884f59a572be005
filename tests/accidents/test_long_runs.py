"""Many pictures of one process: no files, memory or garbage that grows with their number."""

from __future__ import annotations

import json

import pytest

SLOW = pytest.mark.slow
SWEEP = """
import gc, json, os, sys
from pathlib import Path
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.sweep import sweep_scene
from illumcli.scene.variants import variants_of
from illumcli.cache import policy as artifacts

count = int(sys.argv[1])
artifacts.worth = lambda seconds, size: True  # every artifact is kept, however fast it was made

def state():
    with open("/proc/self/statm") as file:
        memory = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return [len(os.listdir("/proc/self/fd")), memory, len(os.listdir("/proc/self/task"))]

def written(outcome):
    assert outcome.error is None, outcome.error
    states.append(state())

gc.disable()
variants = variants_of([f"camera.position.0=1:2:{count}"])
settings = RenderOptions(pattern="out/{camera.position.0}.png", force=True, only=("beauty",))
for again in range(2):
    states = []
    done = sweep_scene(Path("scene.yaml"), variants, settings, written=written)
    assert done.warnings == (), done.warnings
    for outcome in done.outcomes:
        assert not again or outcome.report.rays == {}, outcome.report.rays
print(json.dumps(states))
"""
GARBAGE = """
import gc
from pathlib import Path
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene

render_scene(RenderJob(Path("scene.yaml")))
gc.collect()
gc.disable()
gc.set_debug(gc.DEBUG_SAVEALL)
for again in range(2):
    render_scene(RenderJob(Path("scene.yaml"), RenderOptions(force=True)))
gc.collect()
kinds = [type(value).__name__ for value in gc.garbage]
assert not {"ndarray", "memmap", "Mesh", "Picture"} & set(kinds), sorted(set(kinds))
"""


@pytest.mark.parametrize("count", [24, pytest.param(900, marks=SLOW)])
def test_a_warm_sweep_of_a_moving_camera_opens_no_more_files_and_takes_no_more_memory(python, folder, count):
    scene = (folder / "scene.yaml").read_text()
    (folder / "scene.yaml").write_text(scene.replace("samples: 1}", "samples: 12}"))
    states = json.loads(python(SWEEP, count))
    (files, memory, threads), last = states[count // 4], states[-1]
    assert (last[0], last[2]) == (files, threads)
    assert last[1] < memory + (16 << 20), states  # a picture's artifacts are 3 MB


def test_a_picture_leaves_no_array_to_the_garbage_collector(python, folder):
    scene = (folder / "scene.yaml").read_text()
    (folder / "look.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (folder / "thing.obj").write_text("mtllib look.mtl\nusemtl red\n" + (folder / "thing.obj").read_text())
    changed = scene.replace(
        "thing.obj, material: {model: phong, exponent: 20}", "{file: thing.obj, materials: true}"
    )
    (folder / "scene.yaml").write_text(changed)
    python(GARBAGE)
