"""Relations of meshes: files, polygons and rates that describe the same surface."""

from __future__ import annotations

import copy
from dataclasses import replace
from random import Random

import numpy as np

from illumcli.color import from_srgb
from metamorphic import scenes, surfaces
from metamorphic.pictures import ALL, Pictures, Studio, close, light_layers, same
from metamorphic.premises import (
    SEEN,
    UNCUT,
    UNDRAWN,
    drawn_mesh,
    files_alone,
    fixed_samples,
    from_polygons,
    grained,
    plain_material,
    with_own_meshes,
    without_images,
    without_rays,
)
from metamorphic.relation import relation
from metamorphic.scenes import RATES, Case
from metamorphic.surfaces import Surface


@relation("rounding")
def a_mesh_in_two_parts(case: Case, random: Random, studio: Studio) -> None:
    """The polygons of a file dealt to two files are the same picture. Premises: fixed samples, normals of
    the file, a grain for every object, since tangents along u are means over polygons, shadows that begin on
    polygons, since both parts are no smooth surface any more, and a mesh for every object, since a copy of a
    mesh is an instance only while there is another."""
    case = with_own_meshes(grained(from_polygons(files_alone(fixed_samples(case), random))))
    number = random.randrange(len(case.scene["objects"]))
    thing = case.scene["objects"][number]
    file = case.scene["meshes"][thing["mesh"]]["file"]
    surface = case.meshes[file]
    if len(surface.faces) < 2:
        return
    thing["transform"].pop("fit", None)  # each part would be fitted for itself
    thing["transform"].pop("scale", None)
    picked = [random.random() < 0.5 for _ in surface.faces]
    picked[0], picked[1] = True, False
    split = case.copy()
    parts = []
    for side in (True, False):
        name = f"part{int(side)}.{file.partition('.')[2]}"
        own = [face for face, which in zip(surface.faces, picked, strict=True) if which == side]
        split.meshes[name] = surface.part(own)
        parts.append(copy.deepcopy(thing) | {"mesh": name, "name": f"part{int(side)}"})
    split.scene["objects"][number : number + 1] = parts
    layers = tuple(name for name in (*SEEN, *light_layers(case)) if name not in ("object_id", "material_id"))
    close(studio(case, layers), studio(split, layers), share=1e-5)


@relation("rounding")
def a_flat_face_in_triangles(case: Case, random: Random, studio: Studio) -> None:
    """Flat faces cut into triangles in the file are the same picture. Premises: fixed samples; faces whose
    corners share their normal and materials that do not vary over them; rate `phong`, since triangles have
    centres and sums of corners of their own; a grain for every object, since tangents along u are means over
    triangles; no obscurance, whose rays follow the last bits of normals."""
    case = files_alone(grained(without_rays(fixed_samples(case))), random, surfaces.FLAT)
    for thing in case.scene["objects"]:
        plain_material(random, thing)
    case.scene["shading"] = "phong"
    for thing in case.scene["objects"]:
        thing.pop("shading", None)
    cut = case.copy()
    cut.meshes = {name: surface.triangles() for name, surface in case.meshes.items()}
    layers = (*UNDRAWN, *light_layers(case))
    close(studio(case, layers), studio(cut, layers), share=1e-3)


@relation("rounding")
def the_order_in_a_file_is_free(case: Case, random: Random, studio: Studio) -> None:
    """Vertices and faces of a file in another order are the same picture, with its own normals and with
    computed ones. Premises: fixed samples, a grain for every object, no obscurance, whose rays follow the
    last bits of normals."""
    case = files_alone(grained(without_rays(fixed_samples(case))), random, own=False)
    turned = case.copy()
    turned.meshes = {name: surface.shuffled(random) for name, surface in case.meshes.items()}
    layers = (*UNDRAWN, *light_layers(case))
    close(studio(case, layers), studio(turned, layers), share=1e-3)


@relation("rounding")
def a_polygon_begins_anywhere(case: Case, random: Random, studio: Studio) -> None:
    """Planar polygons that are written from another corner on, and so are cut otherwise, are the same
    picture. Premises: fixed samples, normals of the file, no textures, no obscurance, whose rays follow the
    last bits of normals."""
    case = files_alone(without_rays(fixed_samples(case)), random, surfaces.PLANAR)
    case = grained(without_images(case, random))
    turned = case.copy()
    for name, surface in case.meshes.items():
        steps = [random.randrange(len(face)) for face in surface.faces]
        faces = tuple(face[k:] + face[:k] for face, k in zip(surface.faces, steps, strict=True))
        turned.meshes[name] = replace(surface, faces=faces)
    layers = (*UNCUT, *light_layers(case))
    close(studio(case, layers), studio(turned, layers), share=1e-3)


@relation("exact")
def every_format_says_the_same(case: Case, random: Random, studio: Studio) -> None:
    """The same triangles are the same picture from every format that holds what they have. Premise: no
    vertex colours, which only PLY has here."""
    case = case.copy()
    mesh = drawn_mesh(case, random)
    surface = random.choice(surfaces.SURFACES)(random).triangles()
    flat = random.random() < 0.2
    if flat:
        surface = Surface(surface.vertices, surface.faces)
    for thing in case.scene["objects"]:
        plain_material(random, thing)
        if flat:
            thing["shading"] = "constant"
    kinds = list(surfaces.WRITERS) if flat else [kind for kind in surfaces.WRITERS if kind != "stl"]
    layers = (*ALL, *light_layers(case))

    def written(kind: str) -> Pictures:
        own = case.copy()
        own.meshes[f"same.{kind}"] = surface
        own.scene["meshes"][mesh] = {"file": f"same.{kind}"}
        return studio(own, layers)

    first = written(kinds[0])
    for kind in kinds[1:]:
        same(first, written(kind))


@relation("exact")
def a_file_says_what_the_scene_says(case: Case, random: Random, studio: Studio) -> None:
    """Polygons written in the scene are those of a file. Premise: no uv, no colours."""
    case = case.copy()
    mesh = drawn_mesh(case, random)
    made = random.choice(surfaces.SURFACES)(random)
    surface = Surface(made.vertices, made.faces, made.normals)
    for thing in case.scene["objects"]:
        plain_material(random, thing)
    layers = (*ALL, "triangle_id", *light_layers(case))
    inside, outside = case.copy(), case.copy()
    inside.scene["meshes"][mesh] = surfaces.shape_of(surface)
    kind = random.choice(["obj", "ply", "bin.ply"])
    outside.meshes[f"same.{kind}"] = surface
    outside.scene["meshes"][mesh] = {"file": f"same.{kind}"}
    same(studio(inside, layers), studio(outside, layers))


@relation("rounding")
def a_moved_file_is_a_moved_object(case: Case, random: Random, studio: Studio) -> None:
    """Vertices moved in the file are an object moved. Premises: fixed samples, planar polygons, which may be
    cut otherwise once they are moved, normals of the file, no textures, no mirroring, no grain, no
    obscurance, whose rays follow the last bits of normals."""
    case = files_alone(without_rays(fixed_samples(case)), random, surfaces.PLANAR)
    case = without_images(case, random)
    thing = random.choice(case.scene["objects"])
    thing.pop("grain", None)
    plain_material(random, thing, grained=False)
    file = case.scene["meshes"][thing["mesh"]]["file"]
    matrix = np.eye(4)
    matrix[:3, :3] += np.array([[scenes.number(random, -0.3, 0.3) for _ in range(3)] for _ in range(3)])
    matrix[:3, 3] = scenes.vector(random, 0.5)
    inside, outside = case.copy(), case.copy()
    number = case.scene["objects"].index(thing)
    moved = f"moved.{file.partition('.')[2]}"
    inside.meshes[moved] = case.meshes[file].moved(matrix)
    inside.scene["objects"][number] |= {"mesh": moved, "transform": {}}
    outside.scene["objects"][number]["transform"] = {"matrix": matrix.tolist()}
    layers = (*UNCUT, *light_layers(case))
    close(studio(inside, layers), studio(outside, layers), share=1e-3)


@relation("rounding")
def rates_agree_on_flat_faces(case: Case, random: Random, studio: Studio) -> None:
    """Two rates mixed are the same light as one. Premises: flat faces, directional lights, orthographic
    views, materials that do not vary nor follow a grain; fixed samples, no obscurance, whose rays follow the
    last bits of normals."""
    case = files_alone(without_rays(fixed_samples(case)), random, surfaces.FLAT)
    scene = case.scene
    scene["lights"] = [
        {"light": "directional", "name": f"l{k}", "direction": [-x for x in scenes.direction(random, 0.3)]}
        for k in range(2)
    ]
    for camera in scene["cameras"].values():
        camera.pop("fov", None)
        camera |= {"projection": "orthographic", "extent": 3.5}
    rates = random.choice([RATES[2:], random.sample(RATES, 2)])  # those at the samples share their order
    for thing in scene["objects"]:
        plain_material(random, thing, grained=False)
        thing["shading"] = random.choice(rates)
    plain = case.copy()
    for thing in plain.scene["objects"]:
        thing["shading"] = "phong"
    layers = ("beauty", "ambient", "emission", "diffuse", "specular", "normal", "l0", "l1")
    close(studio(case, layers), studio(plain, layers), share=1e-4)


@relation("rounding")
def a_plain_image_is_a_colour(case: Case, random: Random, studio: Studio) -> None:
    """A texture of one colour, and vertices that share one, are that colour. Premise: fixed samples."""
    case = fixed_samples(case)
    mesh = drawn_mesh(case, random)
    value = [random.randrange(1, 256) for _ in range(3)]
    surface = random.choice([surfaces.ball, surfaces.hills, surfaces.slab])(random)
    shade = np.broadcast_to(np.array(value, np.uint8), (len(surface.vertices), 3))
    case.meshes["plain.ply"] = Surface(surface.vertices, surface.faces, surface.normals, surface.uvs, shade)
    case.scene["meshes"][mesh] = {"file": "plain.ply"}
    case.images["plain.png"] = np.broadcast_to(np.array(value, np.uint8), (3, 2, 3))
    space = random.choice(["srgb", "linear"])
    linear = from_srgb(np.array(value) / 255)
    by_image = {"texture": "plain.png", "space": space, "filter": random.choice(["bilinear", "nearest"])}
    ways = [
        (by_image, linear if space == "srgb" else np.array(value) / 255),
        ({"vertex": "color"}, linear),
    ]
    for thing in case.scene["objects"]:
        plain_material(random, thing)
        while "diffuse" not in thing["material"]:
            plain_material(random, thing)
    layers = (*SEEN, *light_layers(case))
    for varying, plain in ways:
        a, b = case.copy(), case.copy()
        for thing in (*a.scene["objects"], *b.scene["objects"]):
            if thing["mesh"] == mesh:
                own = varying if thing in a.scene["objects"] else plain.tolist()
                thing["material"] = {**thing["material"], "diffuse": own}
        close(studio(a, layers), studio(b, layers), share=1e-5, outliers=0)
