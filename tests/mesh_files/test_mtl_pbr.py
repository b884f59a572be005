"""MTL in the terms of metallic-roughness: what each statement becomes, and what is left out."""

from __future__ import annotations

from pathlib import Path

import pytest

from illumcli.mesh_files.mtl_pbr import read_pbr
from illumcli.mesh_files.pbr import PbrMaterial


def material(tmp_path: Path, *statements: str) -> PbrMaterial:
    """The material of a library of these statements."""
    path = tmp_path / "a.mtl"
    path.write_text("\n".join(["newmtl clay # red", *statements]))
    return read_pbr(path, tmp_path)["clay"]


def test_colours_and_numbers(tmp_path: Path) -> None:
    result = material(tmp_path, "Kd 0.5 0.25 0", "d 0.5", "Ke 2 0 0", "Pm 1", "Pr 0.3", "Ns 8", "Ks 1 1 1")
    assert result == PbrMaterial("clay", (0.5, 0.25, 0.0), 0.5, 1.0, 0.3, (2.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("statements", "roughness"),
    [
        (["Ks 0.5 0.5 0.5", "Ns 30"], 0.5),
        (["Ks 0 0 0", "Ns 30"], 1.0),
        (["Ks 0.5 0.5 0.5", "Ns 30", "illum 1"], 1.0),
        (["Ks 0.5 0.5 0.5"], 1.0),
        (["Ns 30"], 1.0),
    ],
)
def test_the_exponent_becomes_a_roughness(tmp_path: Path, statements: list[str], roughness: float) -> None:
    assert material(tmp_path, *statements).roughness == pytest.approx(roughness)


def test_transparency_by_either_statement(tmp_path: Path) -> None:
    assert material(tmp_path, "Tr 0.25").alpha == 0.75
    assert material(tmp_path, "Tr 0.25", "d 0.5").alpha == 0.5
    assert material(tmp_path).alpha == 1


def test_images(tmp_path: Path) -> None:
    for name in ("a b.png", "n.png", "e.png", "s.png"):
        (tmp_path / name).write_bytes(b"")
    result = material(
        tmp_path,
        "map_Kd -clamp on a b.png",
        "map_d a b.png",
        "map_Ke e.png",
        "norm -bm 2 n.png",
        "map_Ks s.png",
        "map_Bump lost.png",
    )
    assert result.textures == {
        "base_color": str(tmp_path / "a b.png"),
        "emission": str(tmp_path / "e.png"),
        "normal": str(tmp_path / "n.png"),
    }
    assert result.clamped == ("base_color",)
    assert result.has_texture_alpha
    assert result.emission == (1.0, 1.0, 1.0)
    assert result.left_out == (
        "map_ks of material clay",
        "map_bump of material clay",
        "options of norm of material clay",
    )


def test_alpha_of_another_image_is_left_out(tmp_path: Path) -> None:
    for name in ("a.png", "d.png"):
        (tmp_path / name).write_bytes(b"")
    result = material(tmp_path, "map_Kd a.png", "map_d d.png")
    assert not result.has_texture_alpha
    assert result.left_out == ("map_d of material clay",)


def test_what_is_malformed_has_its_default(tmp_path: Path) -> None:
    result = material(tmp_path, "Kd red", "d -1", "Pr nan", "Ke 1 x 0", "map_Kd", "Kd")
    assert result == PbrMaterial("clay", left_out=result.left_out)
    assert read_pbr(tmp_path / "none.mtl", tmp_path) == {}
