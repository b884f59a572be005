"""uv made by xatlas, in a process of its own."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

from illumcli.atlas import unwrap as module
from illumcli.atlas.overlaps import overlaps
from illumcli.atlas.texels import texels_of
from illumcli.atlas.triangles import TextureSize, atlas_triangles
from illumcli.atlas.unwrap import unwrapped
from illumcli.errors import IllumError, InputError
from illumcli.progress import no_progress

pytest.importorskip("xatlas")

SIZE = TextureSize(64, 64)
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
BOX = np.array([[q[a], q[b], q[c]] for q in QUADS for a, b, c in ((0, 1, 2), (0, 2, 3))], np.int32)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_uv_neither_overlap_nor_are_mirrored_at_any_scale(scale):
    result = unwrapped(CORNERS * scale + 3 * scale, BOX, SIZE, no_progress)
    assert result.corner_uvs.shape == BOX.shape
    assert result.uvs.min() >= 0
    assert result.uvs.max() <= 1
    triangles = atlas_triangles(SIZE, result.uvs, result.corner_uvs, np.arange(12, dtype=np.int32))
    assert len(triangles.triangle) == 12
    assert not triangles.is_mirrored.any()
    facts = overlaps(triangles, texels_of(triangles).places)
    assert facts.several == 0
    assert facts.read > 0.4 * SIZE.texels


def test_an_interrupt_ends_the_process(monkeypatch):
    started = []
    popen = subprocess.Popen
    monkeypatch.setattr(
        module.subprocess, "Popen", lambda *args, **more: started.append(popen(*args, **more)) or started[0]
    )

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        unwrapped(CORNERS, BOX, SIZE, interrupt)
    assert started[0].returncode is not None


def test_a_failure_says_why(monkeypatch):
    monkeypatch.setattr(module, "_COMMAND", ("-c", "raise SystemExit('out of charts')"))
    with pytest.raises(IllumError, match="xatlas ended with 1: out of charts"):
        unwrapped(CORNERS, BOX, SIZE, no_progress)


def test_a_missing_library_is_told_with_its_command(monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'illumcli\[unwrap\]'"):
        module.refuse_missing_library()
