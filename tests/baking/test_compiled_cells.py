"""The compiled loop gives the bits of numpy: cells near each other, moments and fits of their points."""

from __future__ import annotations

import numpy as np
import pytest

from conftest import needs_loop
from illumcli.baking import compiled_cells
from illumcli.baking.cells import nearest
from illumcli.baking.compiled_cells import MOST_WINDOWS, cell_loop
from illumcli.baking.points import Points
from illumcli.baking.reconstruction import WINDOWS, RawValues, reconstruct, rotated_cells
from illumcli.compiled import SWITCH
from illumcli.geometry.scene_geometry import SceneGeometry


@pytest.fixture(autouse=True)
def _needs_the_loop(monkeypatch):
    needs_loop(cell_loop, monkeypatch)


def both(monkeypatch, compute):
    """Results of the compiled loop and of numpy."""
    monkeypatch.delenv(SWITCH, raising=False)
    ours = compute()
    monkeypatch.setenv(SWITCH, "0")
    return ours, compute()


class DensePoints(Points):
    cell_size = 32
    is_dense = True


@pytest.mark.parametrize("kind", [Points, DensePoints])
@pytest.mark.parametrize("count", [1, 5, 8, 9, 300, 20_000])
def test_reconstructions_have_the_same_bits(monkeypatch, kind, count):
    rng = np.random.default_rng(count)
    n = rng.normal((0, 2, 0), 1, (count, 3))
    points = kind(
        geometry=SceneGeometry.__new__(SceneGeometry),
        n=np.asfortranarray(n / np.linalg.norm(n, axis=1, keepdims=True), np.float32),
        position=np.asfortranarray(rng.random((count, 3)) * [1, 0.01, 1], np.float32),
        key=np.arange(count, dtype=np.uint32),
        objects=rng.integers(0, 3, count).astype(np.int32),
        is_flat=np.ones(count, bool),
    )
    hidden = rng.random(count) * (points.position[:, 0] > 0.3)
    raw = RawValues(hidden, rng.random(count) / 100, n.astype(np.float32))
    ours, theirs = both(monkeypatch, lambda: reconstruct(points, rotated_cells(points, 2), raw, 2))
    for name in ("hidden", "risk", "bent"):
        assert getattr(ours, name).tobytes() == getattr(theirs, name).tobytes()
    assert ours.windows == theirs.windows


@pytest.mark.parametrize("count", [1, 16, 17, 4096])
def test_nearest_cells_are_the_same_where_many_are_equally_near(monkeypatch, count):
    side = int(np.ceil(count**0.5))
    x, z = np.divmod(np.arange(count), side)
    zero = np.zeros(count)
    centre = np.stack([x / side, zero, z / side, zero], axis=1)
    normal = np.repeat([[0.0, 1.0, 0.0]], count, axis=0)
    ours, theirs = both(monkeypatch, lambda: nearest(centre, normal, 16))
    assert ours.tobytes() == theirs.tobytes()
    assert (ours[:, 0] == np.arange(count)).all()


def test_cells_at_one_place_are_nearest_to_themselves(monkeypatch):
    centre, normal = np.zeros((5000, 4)), np.repeat([[0.0, 1.0, 0.0]], 5000, axis=0)
    for found in both(monkeypatch, lambda: nearest(centre, normal, 4)):
        assert (found[:, 0] == np.arange(5000)).all()


def test_the_loop_has_room_for_all_windows():
    assert len(WINDOWS) <= MOST_WINDOWS


def test_a_library_of_another_interface_is_not_used(monkeypatch):
    assert cell_loop() is not None
    monkeypatch.setattr(compiled_cells, "INTERFACE", -1)
    assert cell_loop() is None
