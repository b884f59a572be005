"""Outputs that were damaged or changed since they were written are never kept for the same."""

from __future__ import annotations

import random

import pytest

from illumcli.baking import bake as ao_bake
from illumcli.commands import render
from illumcli.errors import OutputError


def picture(folder, name):
    def make(force=False):
        _, report = render.run(
            folder / "scene.yaml", force=force, threads=1, cache=False, pattern=str(folder / name),
            overrides=["film.width=24", "film.height=16"], only=["beauty"],
        )  # fmt: skip
        return [str(path) for path in report.kept]

    return make


def bake(folder, name):
    def make(force=False):
        settings = ao_bake.Settings(samples=8)
        return ao_bake.run(folder / "thing.obj", [folder / name], settings, force=force)[1].kept

    return make


OUTPUTS = {"a.exr": picture, "a.png": picture, "a.npz": bake, "a.ply": bake, "a.glb": bake}


@pytest.mark.parametrize("name", OUTPUTS)
@pytest.mark.parametrize("count", [10, pytest.param(300, marks=pytest.mark.slow)])
def test_a_damaged_output_is_refused_and_made_anew_by_force(folder, name, count):
    make, path = OUTPUTS[name](folder, name), folder / name
    make()
    assert make() == [str(path)]
    whole, draw = path.read_bytes(), random.Random(name)
    for number in range(count):
        at = draw.randrange(len(whole))
        data = bytearray(whole)
        data[at] ^= 1 << draw.randrange(8)
        damaged = bytes(data) if number % 2 else whole[:at]
        path.write_bytes(damaged)
        with pytest.raises(OutputError, match="changed or damaged since it was written; use --force"):
            make()
        assert path.read_bytes() == damaged
    make(force=True)
    assert path.read_bytes() == whole
