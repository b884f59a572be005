"""Workers of a cluster have the models of the client's folder, whether they see the folder or not."""

from __future__ import annotations

import os

import pytest

from cluster.machines import HIDDEN
from cluster.test_cluster import illum, pictures

MODEL = """
from typing import Literal

from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo

from ._help import POWER


class Chalk(IlluminationModel):
    model: Literal["chalk"] = "chalk"
    diffuse: Varying[Albedo] = (0.5, 0.5, 0.5)

    def diffuse_lobe(self, n_l):
        return tint(self.diffuse, n_l**POWER)
"""
SWEEP = ("sweep", "s.yaml", "-D", "objects.0.material.diffuse=0.2,0.4,0.6", "--models", "own", "--no-cache")


@pytest.mark.parametrize("is_hidden", [False, True])
def test_workers_have_the_models_of_the_client(scene, machines, is_hidden):
    if is_hidden and os.geteuid() != 0:
        pytest.skip("only root can hide a folder from a process")
    folder = scene.parent
    scene.write_text(scene.read_text().replace("material: clay}", "material: {model: chalk}}", 1))
    (folder / "own").mkdir()
    (folder / "own" / "chalk.py").write_text(MODEL)
    (folder / "own" / "_help.py").write_text("POWER = 3\n")
    illum(folder, *SWEEP)
    expected = pictures(folder)
    assert len(expected) == 3
    for name in expected:
        (folder / name).unlink()

    machines.start_worker([*HIDDEN, str(folder)] if is_hidden else [])
    illum(folder, *SWEEP, "--cluster", machines.address)
    assert pictures(folder) == expected
