"""Every skip saves something on the scene made for it and changes no value of the picture."""

from __future__ import annotations

import importlib.util
import sys

import pytest

SKIPS = (
    "lights of intensity 0", "points a light does not reach", "points in shadow", "lobes that are black",
    "ambient light of 0", "k_a of 0", "emission of 0", "directions nobody reads", "layers nobody asks for",
    "objects no view can tell", "ids alone",
)  # fmt: skip


@pytest.fixture(scope="module")
def bench(request):
    root = request.config.rootpath
    spec = importlib.util.spec_from_file_location("skips", root / "benchmarks" / "skips.py")
    module = sys.modules["skips"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules["skips"]


def test_the_list_is_complete(bench):
    assert tuple(skip.name for skip in bench.SKIPS) == SKIPS


@pytest.mark.parametrize("name", SKIPS)
def test_a_skip_saves_work_and_changes_no_value(bench, name):
    ((_, few, many, same),) = bench.compared(40, lambda skip: skip.name == name)
    assert same
    assert all(few[what] <= many[what] for what in few if what != "steps")
    assert any(few[what] < many[what] for what in few)


def test_gouraud_and_constant_are_evaluated_where_they_are_seen(bench, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(bench.SCENE.replace("WIDTH", "24"))
    samples = 24 * 24 * 2
    for rate in ("gouraud", "constant"):
        vertices = "objects.ball.mesh.segments=256"
        skip = bench.Skip(rate, (f"shading={rate}", "ambient=0", vertices, "objects.ball.mesh.rings=256"))
        _, counts = bench.render(path, skip, ("beauty",))
        assert 0 < counts["responses"] < 2 * 3 * samples < 256 * 255
