"""Baked obscurance as npz: what is read is what was written, in the order of the mesh's vertices."""

from __future__ import annotations

import numpy as np
import pytest

from baked_values import ABOUT, SQUARE, baked
from illumcli.errors import InputError
from illumcli.visibility.baked import Baked, mesh_hash, read_npz, write_npz


@pytest.mark.parametrize("bent", [False, True])
def test_npz_gives_back_what_was_baked(tmp_path, bent):
    write_npz(tmp_path / "a.npz", baked(bent=bent, **ABOUT))
    found = read_npz(tmp_path / "a.npz")
    assert found.obscurance.tolist() == baked().obscurance.tolist()
    assert found.standard_error.tolist() == baked().standard_error.tolist()
    assert ("bent_normal" in found.channels) == bent
    assert found.about == ABOUT
    assert found.hashes() == ["hash a", "hash b"]


def test_a_bake_of_several_gives_each_object_its_own_part():
    both = baked(8, vertices={"a": 3, "b": 5})
    assert both.of("anything", 8) is both.obscurance
    assert both.of("a", 3).tolist() == both.obscurance[:3].tolist()
    assert both.of("b", 5).tolist() == both.obscurance[3:].tolist()
    assert both.of("b", 3) is None
    assert both.of("c", 5) is None
    assert Baked(both.channels).hashes() == []


@pytest.mark.parametrize(
    "arrays",
    [
        {"obscurance": [0.5, 1.5], "standard_error": [0, 0]},
        {"obscurance": [0.5, -0.1], "standard_error": [0, 0]},
        {"obscurance": [0.5, np.nan], "standard_error": [0, 0]},
        {"obscurance": [[0.5]], "standard_error": [[0]]},
        {"obscurance": [0.5, 1], "standard_error": [0]},
    ],
)
def test_numbers_that_are_no_obscurance_are_refused(tmp_path, arrays):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputError, match=r"a\.npz: obscurance must be one number from 0 to 1 per vertex"):
        read_npz(tmp_path / "a.npz")


def test_a_bake_without_a_word_about_itself_is_read(tmp_path):
    np.savez(tmp_path / "a.npz", obscurance=[0.0, 1.0], standard_error=[0, 0])
    assert read_npz(tmp_path / "a.npz").about == {}


def test_files_that_are_no_bake_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", w=[1.0])
    np.savez(tmp_path / "pickled.npz", obscurance=np.array([None]), standard_error=[0])
    (tmp_path / "text.npz").write_text("some text that is long enough for a header")
    for name in ("other.npz", "pickled.npz", "text.npz", "none.npz"):
        with pytest.raises(InputError, match=rf"{name}: is no baked obscurance .*bake it with illum"):
            read_npz(tmp_path / name)


def test_the_hash_of_a_mesh_is_that_of_its_geometry():
    corners, starts = np.arange(4, dtype=np.int32), np.array([0, 4], np.int32)
    own = mesh_hash(SQUARE, corners, starts)
    assert own == mesh_hash(np.asfortranarray(SQUARE), corners.copy(), starts)
    assert len(own) == 32
    assert own != mesh_hash(SQUARE + 1e-12, corners, starts)
    assert own != mesh_hash(SQUARE, corners[::-1].copy(), starts)
    assert own != mesh_hash(SQUARE, corners, np.array([0, 3], np.int32))
