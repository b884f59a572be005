"""Materials of glTF files, as keys of a scene's materials: every one of them must be valid there."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh, Substitute
from illumcli.mesh_files import embedded_image, holds_obscurance, image_within, read_mesh
from illumcli.models.metallic_roughness import MetallicRoughness
from illumcli.scene.load import load
from illumcli.shading.materials import imported_model
from metamorphic.scenes import png
from planned import layers_of, planned

UV = [[0, 0], [1, 0], [1, 1], [0, 1]]
PNG = b"\x89PNG not looked at here"
BLACK, WHITE = (0, 0, 0), (1, 1, 1)
NO_NUMBERS = "values of materials that are no finite numbers replaced by their defaults"
OUTSIDE = "values of materials outside their range clipped to it"


@pytest.fixture
def library(tmp_path: Path, square: Any) -> Any:
    """The mesh of a square with one material, of two texture coordinates where it is asked for uv."""

    def read(material: dict, uv: bool = False, color: bool = False, **more: Any) -> Mesh:
        scene = square()
        primitive = scene.json["meshes"][0]["primitives"][0]
        if uv:
            primitive["attributes"]["TEXCOORD_0"] = scene.table(UV)
            primitive["attributes"]["TEXCOORD_1"] = scene.table(np.array(UV) / 2)
        if color:
            primitive["attributes"]["COLOR_0"] = scene.table([[1, 0.5, 0, 1]] * 4)
        primitive["material"] = 0
        image = scene.table(np.frombuffer(PNG, "u1"), "u1")
        view = scene.json["accessors"][image]["bufferView"]
        scene.json |= {
            "materials": [{"name": "paint", **material}],
            "textures": [{"source": 0}, {"source": 1, "sampler": 0}],
            "images": [{"bufferView": view, "mimeType": "image/png"}, {"uri": "my%20wood.png"}],
            "samplers": [{}],
        }
        scene.json |= more
        (tmp_path / "my wood.png").write_bytes(PNG)
        mesh = read_mesh(scene.write(tmp_path / "a.glb"))
        imported_model(mesh.materials["paint"], Path())  # valid as it stands
        return mesh

    return read


def told(mesh: Mesh) -> dict[str, int]:
    return {what: each.count for what, each in mesh.material_repairs.items()}


def test_a_material_is_metal_and_rough_unless_it_says_otherwise(library: Any) -> None:
    mesh = library({"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}})
    assert mesh.materials["paint"] == {
        "model": "metallic_roughness",
        "base_color": (1, 0, 0),
        "metallic": 1,
        "roughness": 1,
        "emission": BLACK,
    }
    assert told(mesh) == {}


def test_factors(library: Any) -> None:
    said = {"baseColorFactor": [0.5, 0.25, 1, 1], "metallicFactor": 0, "roughnessFactor": 0.5}
    keys = library({"pbrMetallicRoughness": said}).materials["paint"]
    assert (keys["base_color"], keys["metallic"], keys["roughness"]) == ((0.5, 0.25, 1), 0, 0.5)


@pytest.mark.parametrize(
    ("said", "index", "what"),
    [
        (2, 2, None),
        (0.5, 1, OUTSIDE),
        (-1, 1, OUTSIDE),
        (0, 1e3, None),
        (1e9, 1e3, None),
        ("much", None, NO_NUMBERS),
    ],
)
def test_an_index(library: Any, said: Any, index: float | None, what: str | None) -> None:
    mesh = library({"extensions": {"KHR_materials_ior": {"ior": said}}})
    assert mesh.materials["paint"].get("ior") == index
    assert told(mesh) == ({} if what is None else {what: 1})


def test_factors_out_of_range_or_none_are_mended(library: Any) -> None:
    said = {
        "baseColorFactor": [2, -1, 0.5, 1],
        "metallicFactor": "much",
        "roughnessFactor": -3,
    }
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": None}}
    material = {"pbrMetallicRoughness": said, "emissiveFactor": [1, 2], "extensions": strength}
    mesh = library(material)
    keys = mesh.materials["paint"]
    assert (keys["base_color"], keys["metallic"], keys["roughness"]) == ((1, 0, 0.5), 1, 0)
    assert keys["emission"] == BLACK
    assert told(mesh) == {NO_NUMBERS: 3, OUTSIDE: 2}
    assert mesh.material_repairs[OUTSIDE].first == ": materials[0].baseColorFactor"
    mesh = library({"pbrMetallicRoughness": 7, "extensions": 3})
    assert mesh.materials["paint"]["base_color"] == WHITE
    assert told(mesh) == {"parts of materials that are no objects left out": 1}


@pytest.mark.parametrize(
    ("said", "metallic", "base", "what"),
    [
        ({"metallicFactor": 3}, 1, WHITE, OUTSIDE),
        ({"metallicFactor": math.nan}, 1, WHITE, NO_NUMBERS),
        ({"metallicFactor": None}, 1, WHITE, NO_NUMBERS),
        ({"metallicFactor": True}, 1, WHITE, NO_NUMBERS),
        ({"baseColorFactor": [0.5, 0.5]}, 1, WHITE, NO_NUMBERS),
        ({"baseColorFactor": [0.5, math.nan, 0.5, 1]}, 1, WHITE, NO_NUMBERS),
        ({"baseColorFactor": [0.5, 0.5, math.inf, 1]}, 1, WHITE, NO_NUMBERS),
    ],
)
def test_each_mended_factor_is_counted(
    library: Any, said: Any, metallic: float, base: Any, what: str
) -> None:
    mesh = library({"pbrMetallicRoughness": said})
    assert mesh.materials["paint"]["metallic"] == metallic
    assert mesh.materials["paint"]["base_color"] == base
    assert told(mesh) == {what: 1}


def test_an_unknown_alpha_mode_is_opaque(library: Any) -> None:
    assert told(library({"alphaMode": "FOO"})) == {"unknown alphaMode FOO of materials taken as OPAQUE": 1}
    assert told(library({"alphaMode": "OPAQUE"})) == {}


def test_metal_and_roughness_are_channels_of_one_texture(library: Any, tmp_path: Path) -> None:
    said = {"metallicRoughnessTexture": {"index": 1, "texCoord": 1}, "roughnessFactor": 0.5}
    mesh = library({"pbrMetallicRoughness": said}, uv=True)
    keys = mesh.materials["paint"]
    texture = {"texture": str(tmp_path / "my wood.png"), "space": "linear", "uv": "uv1"}
    assert keys["metallic"] == {**texture, "channel": "b"}
    assert keys["roughness"] == {**texture, "channel": "g", "factor": (0.5, 0.5, 0.5)}
    assert told(mesh) == {}
    # where the image turns out to be unusable
    assert mesh.substitutes["paint"]["metallic"].value == BLACK
    assert mesh.substitutes["paint"]["roughness"].value == (0.5, 0.5, 0.5)


def test_without_its_texture_nothing_is_metal(library: Any) -> None:
    said = {"metallicRoughnessTexture": {"index": 9}, "roughnessFactor": 0.5}
    mesh = library({"pbrMetallicRoughness": said}, uv=True)
    keys = mesh.materials["paint"]
    assert (keys["metallic"], keys["roughness"]) == (0, 0.5)
    assert told(mesh) == {"textures left out (refers to textures[9], which is not there)": 1}


def test_a_factor_of_zero_needs_no_texture(library: Any) -> None:
    said = {"metallicRoughnessTexture": {"index": 1}, "metallicFactor": 0}
    keys = library({"pbrMetallicRoughness": said}, uv=True).materials["paint"]
    assert keys["metallic"] == 0
    assert keys["roughness"]["channel"] == "g"


def test_base_colour_is_factor_times_texture_times_vertex_colour(library: Any, tmp_path: Path) -> None:
    said = {
        "baseColorTexture": {"index": 1},
        "baseColorFactor": [0.5, 1, 1, 1],
        "metallicFactor": 0,
    }
    mesh = library({"pbrMetallicRoughness": said}, uv=True, color=True)
    base = {"texture": str(tmp_path / "my wood.png"), "factor": (0.5, 1, 1), "vertex": "color"}
    assert mesh.materials["paint"]["base_color"] == base
    assert mesh.substitutes["paint"]["base_color"] == Substitute((0.5, 1, 1), ": materials[0]")
    plain = library({"pbrMetallicRoughness": {}}, color=True).materials["paint"]
    assert plain["base_color"] == {"vertex": "color"}
    model = imported_model(mesh.materials["paint"], Path("/somewhere"))
    assert isinstance(model, MetallicRoughness)
    assert model.varying()["base_color"].texture.startswith("/")


def test_images_within_the_file(library: Any, tmp_path: Path) -> None:
    mesh = library({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, uv=True)
    name = mesh.materials["paint"]["base_color"]["texture"]
    assert image_within(name) == (str(tmp_path / "a.glb"), 0)
    assert embedded_image(tmp_path / "a.glb", 0) == PNG
    assert image_within("a.glb") is None
    with pytest.raises(InputError, match=r"refers to images\[2\]"):
        embedded_image(tmp_path / "a.glb", 2)


def test_images_in_data_uris(library: Any, tmp_path: Path) -> None:
    uri = "data:image/png;base64," + base64.b64encode(PNG).decode()
    said = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    mesh = library(said, uv=True, images=[{"uri": uri}])
    assert mesh.materials["paint"]["base_color"]["texture"] == f"{tmp_path / 'a.glb'}#images[0]"
    assert embedded_image(tmp_path / "a.glb", 0) == PNG


def test_other_texture_coordinates_become_attributes(library: Any) -> None:
    turned = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    mesh = library(
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}},
            "emissiveFactor": [1, 1, 1],
            "emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": turned}},
        },
        uv=True,
    )
    keys = mesh.materials["paint"]
    assert keys["base_color"]["uv"] == "uv1"
    np.testing.assert_allclose(mesh.attributes["uv1"], np.array(UV) / 2 * [1, -1] + [0, 1])
    # the extension's own example: the lower left quarter of the image, turned clockwise
    found = mesh.attributes[keys["emission"]["uv"]] * [1, -1] + [0, 1]
    np.testing.assert_allclose(found, [[0, 1], [0, 0.5], [0.5, 0.5], [0.5, 1]], atol=1e-7)


def test_the_set_of_a_transform_comes_first(library: Any) -> None:
    said = {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    mesh = library({"pbrMetallicRoughness": {"baseColorTexture": said}}, uv=True)
    assert mesh.materials["paint"]["base_color"]["uv"] == "uv1"


@pytest.mark.parametrize(
    ("sampler", "keys", "counted"),
    [
        ({"wrapS": 33071, "wrapT": 33071, "magFilter": 9728}, {"wrap": "clamp", "filter": "nearest"}, 0),
        ({"wrapS": 33648, "wrapT": 33648, "magFilter": 9729}, {"wrap": "mirror"}, 0),
        ({"wrapS": 10497}, {}, 0),
        ({"wrapS": 33071}, {"wrap": "clamp"}, 1),
    ],
)
def test_samplers(library: Any, sampler: dict, keys: dict, counted: int) -> None:
    said = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
    mesh = library(said, uv=True, samplers=[sampler])
    found = dict(mesh.materials["paint"]["base_color"])
    del found["texture"]
    assert found == keys
    assert told(mesh).get("textures that wrap in two ways, wrapped in the first", 0) == counted


def test_emission_is_factor_times_strength(library: Any) -> None:
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 10}}
    keys = library({"emissiveFactor": [1, 0.5, 0], "extensions": strength}).materials["paint"]
    assert keys["emission"] == (10, 5, 0)
    textured = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 1}, "extensions": strength}
    assert library(textured, uv=True).materials["paint"]["emission"]["factor"] == (10, 10, 10)
    dark = {"emissiveTexture": {"index": 1}}
    assert library(dark, uv=True).materials["paint"]["emission"] == BLACK


def test_unlit_materials_are_light_of_their_own(library: Any) -> None:
    said = {
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0, 0, 1]},
        "extensions": {"KHR_materials_unlit": {}},
    }
    mesh = library(said)
    assert mesh.materials["paint"] == {
        "model": "lambert",
        "diffuse": BLACK,
        "ambient": BLACK,
        "emission": (0.5, 0, 0),
    }
    assert told(mesh) == {}


def test_specular_and_glossiness(library: Any) -> None:
    gloss = {
        "diffuseFactor": [1, 0.5, 0, 1],
        "specularFactor": [0.25, 0.5, 0.25],
        "glossinessFactor": 0.5,
    }
    said = {"extensions": {"KHR_materials_pbrSpecularGlossiness": gloss}}
    keys = library(said).materials["paint"]
    assert keys["diffuse"] == (0.5, 0.25, 0)
    assert keys["fresnel"]["f0"] == (0.25, 0.5, 0.25)
    assert keys["distribution"]["alpha"] == 0.25
    gloss["specularGlossinessTexture"] = {"index": 0}
    mesh = library(said)
    assert mesh.materials["paint"]["fresnel"]["f0"] == (0.04, 0.04, 0.04)
    assert told(mesh) == {"textures of specular and glossiness left out": 1}


def test_what_is_not_drawn_is_named(library: Any) -> None:
    said = {
        "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
        "normalTexture": {"index": 0},
        "occlusionTexture": {"index": 0},
        "alphaMode": "MASK",
        "doubleSided": True,
        "extensions": {"KHR_materials_clearcoat": {}, "ACME_glitter": {}},
    }
    mesh = library(said)
    assert told(mesh) == {
        "textures left out (no TEXCOORD_0 to look them up by)": 1,
        "normal textures left out": 1,
        "occlusion textures left out (no TEXCOORD_0 to look them up by)": 1,
        "transparent materials made opaque": 1,
        "extension KHR_materials_clearcoat of materials left out": 1,
        "extension ACME_glitter of materials left out": 1,
    }
    assert mesh.materials["paint"]["metallic"] == 0  # nothing is taken for metal


@pytest.mark.parametrize(
    ("texture", "more", "what"),
    [
        (7, {}, "textures left out (no texture)"),
        ({"index": 9}, {}, "textures left out (refers to textures[9], which is not there)"),
        ({"index": 0}, {"textures": [{}]}, "textures left out (names no image)"),
        ({"texCoord": 0}, {}, "textures left out (names no texture)"),
        (
            {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": "much"}}},
            {},
            "textures left out (KHR_texture_transform.rotation must be a finite number)",
        ),
        ({"index": 0, "texCoord": 3}, {}, "textures left out (no TEXCOORD_3 to look them up by)"),
        ({"index": 0, "texCoord": []}, {}, "textures left out (texture.texCoord must be a whole number"),
        ({"index": 1}, {"images": [{}, {"uri": "absent.png"}]}, "textures that are not there left out"),
        (
            {"index": 1},
            {"images": [{}, {"uri": "../up.png"}]},
            "textures outside the folder of the mesh left",
        ),
        ({"index": 0}, {"images": [{"uri": "a.ktx2"}]}, "textures left out (KTX images are not read)"),
        ({"index": 0}, {"images": [{"bufferView": 99}]}, "textures left out (refers to bufferViews[99]"),
        ({"index": 1}, {"samplers": []}, "textures left out (refers to samplers[0]"),
    ],
)
def test_trouble_with_a_texture_leaves_the_factor(library: Any, texture: Any, more: dict, what: str) -> None:
    said = {"baseColorTexture": texture, "baseColorFactor": [1, 0, 0, 1]}
    mesh = library({"pbrMetallicRoughness": said}, uv=True, **more)
    assert mesh.materials["paint"]["base_color"] == (1, 0, 0)
    assert any(each.startswith(what) for each in mesh.material_repairs), mesh.material_repairs


def test_a_texture_elsewhere_is_taken_from_beside(library: Any, tmp_path: Path) -> None:
    said = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
    mesh = library(said, uv=True, images=[{}, {"uri": "C:\\art\\my wood.png"}])
    assert mesh.materials["paint"]["base_color"]["texture"] == str(tmp_path / "my wood.png")
    assert "textures outside the folder of the mesh replaced by those of the same name in it" in told(mesh)


def test_images_of_extensions_stand_in_for_a_missing_source(library: Any) -> None:
    said = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    texture = {"extensions": {"EXT_texture_webp": {"source": 1}}}
    mesh = library(said, uv=True, textures=[texture])
    assert mesh.materials["paint"]["base_color"]["texture"].endswith("my wood.png")
    mesh = library(said, uv=True, textures=[{"source": 0, **texture}])
    assert mesh.materials["paint"]["base_color"]["texture"].endswith("#images[0]")


def test_materials_of_one_name_stay_apart(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.primitive([0, 1, 2])["material"] = 1
    scene.json["meshes"][0]["primitives"][0]["material"] = 0
    scene.json["materials"] = [{"name": "paint"}, {"name": "paint", "emissiveFactor": [1, 1, 1]}]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.material_names == ("paint", "paint (1)")
    assert mesh.materials["paint"]["emission"] == BLACK
    assert mesh.materials["paint (1)"]["emission"] == WHITE


def test_colours_without_a_material_have_one_of_their_own(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.primitive([0, 1, 2], COLOR_0=scene.table([[1, 0, 0]] * 4))
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.polygon_materials is not None
    assert mesh.polygon_materials.tolist() == [-1, -1, 0]
    assert mesh.materials == {"vertex colours": {"model": "lambert", "diffuse": {"vertex": "color"}}}


def test_a_material_that_is_not_there(tmp_path: Path, square: Any) -> None:
    scene = square()
    for number in (3, "0"):
        scene.json["meshes"][0]["primitives"][0]["material"] = number
        mesh = read_mesh(scene.write(tmp_path / "a.glb"))
        assert mesh.material_names == ()
        assert mesh.repairs["materials that are not there"].count == 1


def test_notes_on_materials_are_not_of_the_mesh(library: Any) -> None:
    mesh = library({"normalTexture": {"index": 0}})
    assert mesh.repairs == {}
    assert json.loads(json.dumps(told(mesh))) == {"normal textures left out": 1}


def test_occlusion_textures_have_their_coordinates_and_strength(library: Any) -> None:
    transform = {"KHR_texture_transform": {"offset": [0.5, 0], "texCoord": 1}}
    said = {"occlusionTexture": {"index": 1, "strength": 0.25, "extensions": transform}}
    mesh = library(said, uv=True)
    keys = mesh.occlusion["paint"]
    assert (keys["strength"], keys["texture"].rpartition("/")[2]) == (0.25, "my wood.png")
    np.testing.assert_allclose(mesh.attributes[keys["uv"]], [1, -1] * np.array(UV) / 2 + [0.5, 1])
    assert library({"occlusionTexture": {"index": 0}}, uv=True).occlusion["paint"]["strength"] == 1
    assert not library({}, uv=True).occlusion


@pytest.mark.parametrize(
    ("parameters", "count"), [(None, False), ({"texture": None}, False), ({"texture": [4, 4]}, True)]
)
def test_values_at_vertices_count_unless_the_same_bake_wrote_textures(
    tmp_path: Path, square: Any, parameters: Any, count: bool
) -> None:
    scene = square()
    primitive = scene.json["meshes"][0]["primitives"][0]
    primitive["attributes"] |= {"TEXCOORD_0": scene.table(UV), "_OBSCURANCE": scene.table([0, 0, 1, 1])}
    primitive["material"] = 0
    (tmp_path / "w.png").write_bytes(PNG)
    scene.json |= {
        "materials": [{"name": "paint", "occlusionTexture": {"index": 0}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "w.png"}],
    }
    if parameters is not None:
        scene.json["asset"]["extras"] = {"illum": {"parameters": parameters}}
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert bool(mesh.occlusion) == count
    assert mesh.attributes["_OBSCURANCE"].tolist() == [0, 0, 1, 1]
    assert holds_obscurance(tmp_path / "a.glb")
    (tmp_path / "a.glb").write_bytes((tmp_path / "a.glb").read_bytes()[:30])
    assert not holds_obscurance(tmp_path / "a.glb")


def test_a_texture_of_metal_and_roughness_looks_like_its_numbers(tmp_path: Path, square: Any) -> None:
    def picture(name: str, factors: dict, images: Any = None) -> Any:
        scene = square()
        attributes = scene.json["meshes"][0]["primitives"][0]["attributes"]
        attributes |= {"TEXCOORD_0": scene.table(UV), "COLOR_0": scene.table([[1, 0.5, 0.25]] * 4)}
        scene.json["meshes"][0]["primitives"][0]["material"] = 0
        scene.json["materials"] = [{"name": "paint", "pbrMetallicRoughness": factors}]
        if images:
            scene.json |= {"textures": [{"source": 0}], "images": images}
        scene.write(tmp_path / name)
        (tmp_path / "scene.yaml").write_text(f"""\
version: 1
camera: {{position: [0.5, 0.5, 2], target: [0.5, 0.5, 0]}}
film: {{width: 8, height: 8}}
meshes: {{square: {{file: {name}, materials: true}}}}
objects: [{{mesh: square}}]
lights: [{{light: point, position: [1, 1, 1]}}]
""")
        return layers_of(planned(load(tmp_path / "scene.yaml"), ["specular", "diffuse"]))

    # one texel: occlusion, which is not looked at, roughness, metal
    texel = np.array([[[255, 102, 204]]], np.uint8)
    (tmp_path / "orm.png").write_bytes(png(texel))
    textured = picture(
        "a.glb",
        {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.5},
        [{"uri": "orm.png"}],
    )
    plain = picture("b.glb", {"metallicFactor": 0.8, "roughnessFactor": 0.2})
    for layer in ("diffuse", "specular"):
        assert plain[layer].max() > 0
        np.testing.assert_allclose(textured[layer], plain[layer], rtol=1e-5)
