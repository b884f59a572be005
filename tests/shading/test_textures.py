"""Parameters that vary: look-ups against exact values, ranges, what a mesh lacks, what a plan reads."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from illumcli.cache import policy as artifacts
from illumcli.color import Texels, from_srgb
from illumcli.commands.check import check_scenes
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.errors import InputError
from illumcli.geometry.repairs import Repair
from illumcli.images.writer import ImageWriter
from illumcli.models.cook_torrance import CookTorrance
from illumcli.models.oren_nayar import OrenNayar
from illumcli.render_graph.execute import Run, run_once
from illumcli.scene.load import load
from illumcli.shading.textures import Range, bilinear, nearest, parameter_range
from planned import layers_of, planned

F = np.float32
FOUR = Texels(np.array([[[1.0], [2.0]], [[3.0], [4.0]]], F), (0,))  # the row of 3 and 4 is the bottom one


def at(*uv):
    return np.asarray(uv, F).reshape(-1, 2)


def test_v_grows_upwards_from_the_bottom_row():
    np.testing.assert_array_equal(
        nearest(FOUR, at(0.25, 0.25, 0.75, 0.25, 0.25, 0.75, 0.75, 0.75), "repeat")[:, 0], [3, 4, 1, 2]
    )


def test_an_edge_belongs_to_the_texel_that_begins_there():
    np.testing.assert_array_equal(
        nearest(FOUR, at(0, 0, 0.5, 0, 0, 0.5, 0.5, 0.5), "repeat")[:, 0], [3, 4, 1, 2]
    )
    np.testing.assert_array_equal(nearest(FOUR, at(0, 0, 1, 1), "clamp")[:, 0], [3, 2])


def test_bilinear_at_the_centres_is_the_texels_and_halfway_their_mean():
    np.testing.assert_array_equal(bilinear(FOUR, at(0.25, 0.25, 0.75, 0.75), "repeat")[:, 0], [3, 2])
    np.testing.assert_array_equal(bilinear(FOUR, at(0.5, 0.5), "repeat")[:, 0], [2.5])


@pytest.mark.parametrize("lookup", [bilinear, nearest])
def test_a_linear_ramp_comes_back_as_it_is(lookup):
    width, height = 64, 16
    centre = (np.arange(width, dtype=F) + F(0.5)) / width
    ramp = Texels(np.broadcast_to(centre[None, :, None], (height, width, 1)), (0,))
    u = np.random.default_rng(1).uniform(0.02, 0.98, 500).astype(F)
    found = lookup(ramp, np.stack([u, u], axis=1), "clamp")[:, 0]
    np.testing.assert_allclose(found, u, atol=1e-6 if lookup is bilinear else 0.5 / width + 1e-6)


@pytest.mark.parametrize("lookup", [bilinear, nearest])
def test_repeat_shows_the_image_again_and_clamp_its_border(lookup):
    inside = at(0.1, 0.2, 0.6, 0.9, 0.99, 0.5)
    for step in ((3, 0), (0, -2), (-1, 5)):
        np.testing.assert_allclose(
            lookup(FOUR, inside + F(step), "repeat"), lookup(FOUR, inside, "repeat"), atol=1e-5
        )
    np.testing.assert_array_equal(lookup(FOUR, at(-7, -7, 9, 9, -1e30, 1e30), "clamp")[:, 0], [3, 2, 1])
    np.testing.assert_array_equal(bilinear(FOUR, at(0, 0.25), "repeat")[:, 0], [3.5])
    np.testing.assert_array_equal(bilinear(FOUR, at(0, 0.25), "clamp")[:, 0], [3])


@pytest.mark.parametrize("lookup", [bilinear, nearest])
def test_mirror_turns_every_second_image(lookup):
    inside = at(0.1, 0.2, 0.6, 0.9, 0.99, 0.5)
    mirrored = lookup(FOUR, at(1, 1) - inside, "mirror")
    for step in ((1, 1), (-1, 3)):
        found = lookup(FOUR, inside + F(step), "mirror")
        np.testing.assert_allclose(found, mirrored, atol=1e-5)
    np.testing.assert_allclose(
        lookup(FOUR, inside + F((4, -2)), "mirror"), lookup(FOUR, inside, "clamp"), atol=1e-5
    )
    np.testing.assert_array_equal(lookup(FOUR, at(1, 0.25, 2, 0.25), "mirror")[:, 0], [4, 3])


def test_a_uv_just_below_zero_stays_inside():
    assert np.isfinite(bilinear(FOUR, at(-1e-9, -1e-9, 1e30, -1e30), "repeat")).all()


def test_ranges_are_those_of_the_parameters():
    assert parameter_range(OrenNayar(), "sigma") == Range(1, 0, 1.5708)
    assert parameter_range(OrenNayar(), "diffuse") == Range(3, 0, 1)
    assert parameter_range(OrenNayar(), "ambient") == Range(3, 0, 1e18)
    model = CookTorrance.model_validate({"model": "cook_torrance", "distribution": {"D": "ggx"}})
    assert parameter_range(model, "distribution.alpha") == Range(1, 1e-4, 10)


# --- in a scene ----------------------------------------------------------------------------------------

SCENE = """
version: 1
camera: {{projection: orthographic, position: [0, 5, 0], target: [0, 0, 0], up: [0, 0, -1], extent: 2}}
film: {{width: 8, height: 8, samples: 1}}
ambient: {ambient}
materials:
  printed: {material}
objects:
  - {{name: sheet, mesh: {mesh}, material: printed}}
lights:
  - {{light: directional, direction: [0, -1, 0], irradiance: 3.141592653589793, shadows: false}}
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float red
property float green
property float blue
property float worn
element face 1
property list uchar int vertex_indices
end_header
-1 0 1  0 0 0 0
1 0 1  1 0 0 0.5
1 0 -1  1 1 0 3
-1 0 -1  0 1 0 0.5
4 0 1 2 3
"""


@pytest.fixture
def scene(tmp_path):
    def write(material, mesh="{shape: plane}", ambient="0"):
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE.format(material=material, mesh=mesh, ambient=ambient))
        return path

    return write


@pytest.fixture
def picture():
    def render(path, *only, side=None, overrides=()):
        loaded = load(path, overrides)
        steps = planned(loaded, only)
        shared = run_once(steps, Run())
        layers = layers_of(steps, side=side, shared=shared)
        repairs = {}
        for buffer in shared.values():
            repairs |= getattr(buffer, "repairs", {})
        return layers, repairs

    return render


def write_image(path, texels):
    """An 8-bit PNG from (H, W, C) values, the first row on top."""
    names = ["R", "G", "B", "A"][: texels.shape[2]] if texels.shape[2] > 1 else ["Y"]
    with ImageWriter(path, texels.shape[1], texels.shape[0], dict.fromkeys(names, "uint8")) as out:
        out.write_band(0, texels.astype(np.uint8))
    return path


@pytest.fixture
def print_(tmp_path):
    """Four colours: red, green above blue, white."""
    corners = np.array([[[200, 0, 0], [0, 200, 0]], [[0, 0, 200], [200, 200, 200]]])
    return write_image(tmp_path / "print.png", corners)


def test_a_colour_texture_lies_on_the_plane_upright_and_linear(scene, picture, print_):
    path = scene("{model: lambert, diffuse: {texture: print.png, filter: nearest}}")
    beauty = picture(path)[0]["beauty"]
    level = from_srgb(np.array(200 / 255))  # irradiance pi: the radiance is the albedo
    np.testing.assert_allclose(beauty[1, 1], [level, 0, 0], rtol=1e-5)
    np.testing.assert_allclose(beauty[1, 6], [0, level, 0], rtol=1e-5)
    np.testing.assert_allclose(beauty[6, 1], [0, 0, level], rtol=1e-5)
    np.testing.assert_allclose(beauty[6, 6], [level] * 3, rtol=1e-5)


@pytest.mark.parametrize("rate", ["constant", "gouraud", "phong", "quadratic"])
def test_tiles_change_nothing(scene, picture, print_, rate):
    path = scene(
        "{model: oren_nayar, diffuse: {texture: print.png}, sigma: {texture: print.png, channel: g}}",
        "{shape: sphere, segments: 7, rings: 5}",
        ambient="0.2",
    )
    rates = [f"shading={rate}"]
    whole, small = (picture(path, overrides=rates, side=side)[0]["beauty"] for side in (8, 2))
    np.testing.assert_array_equal(whole, small)
    assert whole.std() > 0.01


def test_a_number_reads_its_channel_as_data(scene, picture, tmp_path):
    write_image(tmp_path / "rough.png", np.full((2, 2, 3), (0, 51, 255)))
    textured = scene("{model: oren_nayar, sigma: {texture: rough.png, space: linear, channel: g}}")
    varied = picture(textured)[0]["beauty"]
    plain = picture(scene("{model: oren_nayar, sigma: 0.2}"))[0]["beauty"]
    np.testing.assert_allclose(varied, plain, rtol=1e-6)


def test_values_beyond_the_range_are_clipped_and_counted(scene, picture, tmp_path):
    (tmp_path / "sheet.ply").write_text(PLY)
    path = scene("{model: strauss, smoothness: {vertex: worn}}", "sheet.ply")
    layers, repairs = picture(path)
    clipped = "vertex values beyond material printed: smoothness clipped to 0..1"
    assert {what: each.count for what, each in repairs.items()} == {clipped: 1}
    assert np.isfinite(layers["beauty"]).all()


def test_vertex_colours_are_interpolated(scene, picture, tmp_path):
    (tmp_path / "sheet.ply").write_text(PLY)
    beauty = picture(scene("{model: lambert, diffuse: {vertex: color}}", "sheet.ply"))[0]["beauty"]
    across = (np.arange(8) + 0.5) / 8
    np.testing.assert_allclose(beauty[..., 0], np.tile(across, (8, 1)), atol=1e-6)
    np.testing.assert_allclose(beauty[..., 1], np.tile(1 - across[:, None], (1, 8)), atol=1e-6)


def test_values_are_multiplied_by_a_factor_and_by_an_attribute(scene, picture, print_, tmp_path):
    (tmp_path / "sheet.ply").write_text(PLY)
    across = np.tile((np.arange(8) + 0.5) / 8, (8, 1))
    up = 1 - across.T
    tinted = "{model: lambert, diffuse: {vertex: color, factor: [0.5, 1, 0]}}"
    beauty = picture(scene(tinted, "sheet.ply"))[0]["beauty"]
    np.testing.assert_allclose(beauty, np.stack([across / 2, up, 0 * up], axis=-1), atol=1e-6)

    # the colours stand for uv too: red grows with u, green with v
    plain = picture(scene("{model: lambert, diffuse: {texture: print.png}}"))[0]["beauty"]
    keys = "{texture: print.png, uv: color, vertex: color, factor: [1, 0.5, 1]}"
    beauty = picture(scene(f"{{model: lambert, diffuse: {keys}}}", "sheet.ply"))[0]["beauty"]
    expected = plain * np.stack([across, up / 2, 0 * up], axis=-1)
    np.testing.assert_allclose(beauty, expected, atol=1e-6)

    number = "{texture: print.png, space: linear, channel: g, factor: 0.25, vertex: worn, uv: color}"
    layers, repairs = picture(scene(f"{{model: oren_nayar, sigma: {number}}}", "sheet.ply"))
    assert np.isfinite(layers["beauty"]).all()
    clipped = "vertex values beyond material printed: sigma clipped to 0..1.5708"
    assert {what: each.count for what, each in repairs.items()} == {clipped: 1}


def test_ambient_and_emission_vary_too(scene, picture, print_):
    keys = "{model: strauss, color: {texture: print.png}, smoothness: 0, emission: {texture: print.png}}"
    layers, _ = picture(scene(keys, ambient="0.5"), "ambient", "emission")
    np.testing.assert_allclose(layers["ambient"], layers["emission"] / 2, rtol=1e-5)
    assert layers["emission"].std() > 0.1


@pytest.mark.parametrize(
    ("material", "mesh", "said"),
    [
        (
            "{model: lambert, diffuse: {vertex: paint}}",
            "sheet.ply",
            "object sheet: material printed: diffuse wants the vertex attribute 'paint'; "
            "the mesh has: color, worn",
        ),
        (
            "{model: lambert, diffuse: {vertex: color}}",
            "{shape: plane}",
            "object sheet: material printed: diffuse wants the vertex attribute 'color'; the mesh has: none",
        ),
        (
            "{model: oren_nayar, sigma: {vertex: color}}",
            "sheet.ply",
            "object sheet: material printed: sigma is a number and the vertex attribute 'color' has 3 "
            "numbers per vertex; name another",
        ),
        (
            "{model: lambert, diffuse: {texture: print.png, uv: worn}}",
            "sheet.ply",
            "object sheet: material printed: diffuse wants uv and the vertex attribute 'worn' has 1 "
            "numbers per vertex; name another",
        ),
        (
            "{model: lambert, diffuse: {texture: print.png, vertex: paint}}",
            "{shape: plane}",
            "object sheet: material printed: diffuse wants the vertex attribute 'paint'; the mesh has: none",
        ),
        (
            "{model: lambert, diffuse: {texture: print.png}}",
            "sheet.ply",
            "object sheet: material printed: diffuse is a texture and the mesh has no uv; export it with "
            "uv, or give a value",
        ),
    ],
)
def test_what_a_mesh_lacks_is_said_before_anything_is_rendered(scene, tmp_path, print_, material, mesh, said):
    (tmp_path / "sheet.ply").write_text(PLY)
    loaded = load(scene(material, mesh))
    with pytest.raises(InputError, match="object") as caught:
        run_once(planned(loaded), Run())
    assert caught.value.problems == (said,)


def test_a_missing_texture_is_named_with_its_place(scene, print_):
    path = scene("{model: lambert, diffuse: {texture: prnt.png}}")
    loaded = load(path)
    with pytest.raises(InputError, match=r"scene.yaml:7:\d+: .*prnt.png; did you mean 'print.png'"):
        run_once(planned(loaded), Run())
    assert check_scenes([path]).problems


@pytest.mark.parametrize(
    ("only", "material", "read"),
    [
        (["depth"], "{model: lambert, diffuse: {texture: print.png}}", []),
        (["emission"], "{model: lambert, diffuse: {texture: print.png}}", []),
        (["ambient"], "{model: lambert, diffuse: {texture: print.png}, ambient: 0.5}", []),
        (["beauty"], "{model: lambert, diffuse: {texture: print.png}}", ["lobes_textures"]),
        (["beauty"], "{model: lambert, emission: {texture: print.png}}", ["emission_textures"]),
        (["beauty"], "{model: lambert, diffuse: 0, ambient: {texture: print.png}}", []),
    ],
)
def test_images_are_read_only_for_what_is_made(scene, print_, only, material, read):
    loaded = load(scene(material))
    steps = planned(loaded, only)
    assert [step.output for step in steps.once if step.output.endswith("_textures")] == read


def test_an_image_that_several_parameters_name_is_read_once(scene, picture, print_, monkeypatch):
    from illumcli.images import reader as images

    opened, real = [], images.read_texture
    monkeypatch.setattr(images, "read_texture", lambda *words: opened.append(words) or real(*words))
    keys = "{model: strauss, color: {texture: print.png}, metalness: {texture: print.png, channel: b}}"
    picture(scene(keys, ambient="1"))
    assert len(opened) == 1


def test_a_mesh_library_brings_its_textures(tmp_path, picture, print_):
    (tmp_path / "assets").mkdir()
    print_.rename(tmp_path / "assets" / "print.png")
    (tmp_path / "assets" / "sheet.mtl").write_text("newmtl cover\nKd 1 1 1\nmap_Kd -clamp on print.png\n")
    (tmp_path / "assets" / "sheet.obj").write_text(
        "mtllib sheet.mtl\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "usemtl cover\nf 1/1 2/2 3/3 4/4\n"
    )
    path = tmp_path / "scene.yaml"
    text = SCENE.format(
        material="{model: lambert}", mesh="{file: assets/sheet.obj, materials: true}", ambient=0
    )
    path.write_text(text.replace(", material: printed", ""))
    beauty = picture(path)[0]["beauty"] / np.pi  # blinn_phong has no 1/pi
    level = from_srgb(np.array(200 / 255))
    np.testing.assert_allclose(beauty[0, 0], [level, 0, 0], rtol=1e-5)
    np.testing.assert_allclose(beauty[7, 7], [level] * 3, rtol=1e-5)


OWN = """mtllib own.mtl
v -1 0 1
v 1 0 1
v 1 0 -1
v -1 0 -1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl m
f 1/1 2/2 3/3 4/4
"""


@pytest.fixture
def own(tmp_path):
    """A scene of a mesh with its own library, and the same with its plain colour."""

    def write(library, mesh=OWN):
        (tmp_path / "own.mtl").write_text(library)
        (tmp_path / "own.obj").write_text(mesh)
        scene = SCENE.replace("material: printed", "").format(
            material="{model: lambert}", mesh="{file: own.obj, materials: true}", ambient="0"
        )
        (tmp_path / "own.yaml").write_text(scene)
        return tmp_path / "own.yaml"

    return write


@pytest.mark.parametrize("mesh", [OWN, OWN.replace("vt ", "#").replace("1/1 2/2 3/3 4/4", "1 2 3 4")])
def test_a_texture_of_a_meshes_own_that_cannot_be_used_leaves_its_colour(own, picture, tmp_path, mesh):
    (tmp_path / "print.png").write_bytes(b"no image at all")
    beauty, repairs = picture(own("newmtl m\nKd 0.2 0.4 0.6\nmap_Kd print.png\n", mesh))
    plain, _ = picture(own("newmtl m\nKd 0.2 0.4 0.6\n", mesh))
    np.testing.assert_array_equal(beauty["beauty"], plain["beauty"])
    told = [each for what, each in repairs.items() if "textures that cannot be used left out" in what]
    assert told == [Repair(1, "own.mtl:3")]


def test_a_folder_that_was_copied_has_its_own_textures(own, tmp_path, monkeypatch):
    """What is kept of a mesh does not say where its folder was."""
    monkeypatch.setattr(artifacts, "worth", lambda seconds, size: True)
    write_image(tmp_path / "print.png", np.full((2, 2, 3), 200))
    scene = own("newmtl m\nmap_Kd print.png\n")
    first, _ = render_scene(RenderJob(scene, RenderOptions(pattern=str(tmp_path / "first.png"))))
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("own.obj", "own.mtl", "own.yaml", "print.png"):
        (tmp_path / name).rename(copy / name)
    again, report = render_scene(RenderJob(copy / "own.yaml", RenderOptions(pattern=str(copy / "again.png"))))
    assert "store" in {where for reused in report.reused.values() for where in reused.values()}
    assert again[0].read_bytes() == first[0].read_bytes()


def glb(path, image, materials):
    """A GLB of the sheet from -1 to 1 at y = 0, its uv as the plane has them, with an image within."""
    corners = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], "<f4").tobytes()
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4").tobytes()  # v downwards
    faces = np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
    blocks = [corners, uv, faces, image]
    starts = np.cumsum([0, *map(len, blocks)])
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(block)}
            for start, block in zip(starts, blocks, strict=False)
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9728}],
        "materials": materials,
    }
    text = json.dumps(document).encode()
    data = b"".join(blocks)
    chunks = struct.pack("<I", len(text)) + b"JSON" + text + struct.pack("<I", len(data)) + b"BIN\0" + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


@pytest.mark.parametrize("image", ["whole", "cut"])
def test_a_glb_brings_the_images_within(tmp_path, picture, print_, image):
    (tmp_path / "assets").mkdir()
    data = print_.read_bytes()
    print_.unlink()
    irradiance = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 0.5, 1]}
    materials = [{"pbrMetallicRoughness": irradiance, "extensions": {"KHR_materials_unlit": {}}}]
    glb(tmp_path / "assets" / "sheet.glb", data if image == "whole" else data[:60], materials)
    path = tmp_path / "scene.yaml"
    text = SCENE.format(
        material="{model: lambert}", mesh="{file: assets/sheet.glb, materials: true}", ambient=0
    )
    path.write_text(text.replace(", material: printed", ""))
    layers, repairs = picture(path)
    level = from_srgb(np.array(200 / 255))
    if image == "whole":
        np.testing.assert_allclose(layers["beauty"][0, 0], [level, 0, 0], rtol=1e-5)
        np.testing.assert_allclose(layers["beauty"][0, 7], [0, level, 0], rtol=1e-5)
        np.testing.assert_allclose(layers["beauty"][7, 7], [level, level, level / 2], rtol=1e-5)
        assert not repairs
    else:
        np.testing.assert_allclose(layers["beauty"], np.full((8, 8, 3), [1, 1, 0.5]))
        (what,) = repairs
        assert what.startswith("textures that cannot be used left out (assets/sheet.glb: images[0]: cannot")
        assert repairs[what].first == "assets/sheet.glb: materials[0]"


TEXTURED_PLY = """ply
format ascii 1.0
comment TextureFile print.png
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
property list uchar float texcoord
end_header
-1 0 1
1 0 1
1 0 -1
-1 0 -1
4 0 1 2 3 8 0 0 1 0 1 1 0 1
"""


def test_a_ply_brings_the_images_that_its_header_names(scene, tmp_path, picture, print_):
    (tmp_path / "sheet.ply").write_text(TEXTURED_PLY)
    said, _ = picture(scene("{model: lambert, diffuse: {texture: print.png}}", "sheet.ply"))
    path = scene("{model: lambert}", "{file: sheet.ply, materials: true}")
    path.write_text(path.read_text().replace(", material: printed", ""))
    brought, repairs = picture(path)
    np.testing.assert_array_equal(brought["beauty"], said["beauty"])
    assert said["beauty"].std() > 0.05
    assert repairs == {}
