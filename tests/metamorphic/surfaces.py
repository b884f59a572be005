"""Small surfaces as plain arrays, and as files of every mesh format."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from random import Random

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes.box import Box
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.geometry.triangulate import triangulate

Faces = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Surface:
    """Polygons over vertices that each have one position and at most one normal, uv and colour.

    All numbers are exact in single precision, which is all that some formats hold, and so is 1 - v.
    """

    vertices: NDArray[np.float64]  # (V, 3)
    faces: Faces  # vertex numbers, counter-clockwise seen from outside
    normals: NDArray[np.float64] | None = None  # (V, 3)
    uvs: NDArray[np.float64] | None = None  # (V, 2)
    colors: NDArray[np.uint8] | None = None  # (V, 3) in sRGB

    def __post_init__(self) -> None:
        for name in ("vertices", "normals", "uvs"):
            if (values := getattr(self, name)) is not None:
                object.__setattr__(self, name, np.asarray(values, np.float32).astype(np.float64))
        if self.uvs is not None:
            object.__setattr__(self, "uvs", np.rint(self.uvs * 4096) / 4096)

    def part(self, faces: Sequence[tuple[int, ...]]) -> Surface:
        """These faces and the vertices that they use, in the same order."""
        used = sorted({vertex for face in faces for vertex in face})
        number = {vertex: k for k, vertex in enumerate(used)}

        def of(values: NDArray | None) -> NDArray | None:
            return None if values is None else values[used]

        own = tuple(tuple(number[vertex] for vertex in face) for face in faces)
        return Surface(self.vertices[used], own, of(self.normals), of(self.uvs), of(self.colors))

    def shuffled(self, random: Random) -> Surface:
        """The same vertices and faces in another order."""
        order = random.sample(range(len(self.vertices)), len(self.vertices))
        number = {vertex: k for k, vertex in enumerate(order)}
        faces = [tuple(number[vertex] for vertex in face) for face in self.faces]
        random.shuffle(faces)

        def of(values: NDArray | None) -> NDArray | None:
            return None if values is None else values[order]

        return Surface(self.vertices[order], tuple(faces), of(self.normals), of(self.uvs), of(self.colors))

    def moved(self, matrix: NDArray[np.float64]) -> Surface:
        """The surface under a (4, 4) matrix that keeps the orientation."""
        linear = matrix[:3, :3]
        normals = None
        if self.normals is not None:
            turned = self.normals @ np.linalg.inv(linear)
            normals = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        return replace(self, vertices=self.vertices @ linear.T + matrix[:3, 3], normals=normals)

    def triangles(self) -> Surface:
        """The same with its faces cut into triangles as the program cuts them."""
        corners = np.concatenate([np.array(face) for face in self.faces]).astype(np.int32)
        starts = np.cumsum([0, *map(len, self.faces)]).astype(np.int32)
        cut = triangulate(Mesh(self.vertices, corners, starts))
        return replace(self, faces=tuple(tuple(int(v) for v in corners[row]) for row in cut.corners))


def of_mesh(mesh: Mesh) -> Surface:
    """A mesh whose corners become vertices, one for each position, normal and uv that occur together."""
    rows = np.stack(
        [mesh.corners]
        + [
            np.full(len(mesh.corners), -1) if index is None else index
            for index in (mesh.corner_normals, mesh.corner_uvs)
        ],
        axis=1,
    )
    which, back = np.unique(rows, axis=0, return_inverse=True)
    back = back.ravel()
    normals = None if mesh.normals is None or (which[:, 1] < 0).any() else mesh.normals[which[:, 1]]
    uvs = None if mesh.uvs is None or (which[:, 2] < 0).any() else mesh.uvs[which[:, 2]]
    faces = tuple(
        tuple(int(v) for v in back[a:b]) for a, b in zip(mesh.starts[:-1], mesh.starts[1:], strict=True)
    )
    return Surface(mesh.vertices[which[:, 0]], faces, normals, uvs)


# --- what there is ---------------------------------------------------------------------------------------


def ball(random: Random) -> Surface:
    """A coarse ball with radial normals: quads, triangles at the poles."""
    return of_mesh(Sphere(segments=random.randint(5, 12), rings=random.randint(3, 8)).mesh())


def globe(random: Random) -> Surface:
    """A ball as exporters of unwrapped spheres write it: quads alone, each pole and the seam in copies."""
    columns, rows = random.randint(5, 9), random.randint(3, 6)
    u, v = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows)
    ring = np.sin(np.pi * v)
    ring[[0, -1]] = 0
    turn = 2 * np.pi * (u % 1)
    points = np.stack([ring * np.cos(turn), -np.cos(np.pi * v), -ring * np.sin(turn)], axis=-1)
    points = points.reshape(-1, 3).round(6) + 0.0
    at = np.arange(len(points)).reshape(rows + 1, columns + 1)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    faces = tuple(tuple(map(int, quad)) for quad in quads)
    return Surface(points, faces, points, np.stack([u.ravel(), v.ravel()], axis=1))


def crate(random: Random) -> Surface:
    """A box with flat normals."""
    size = tuple(round(random.uniform(0.6, 2), 2) for _ in range(3))
    return of_mesh(Box(size=size, resolution=random.randint(1, 2)).mesh())


def slab(random: Random) -> Surface:
    """A box of eight vertices whose normals average its sides: the coarsest smooth surface."""
    size = np.array([random.uniform(1, 2), random.uniform(0.2, 1), random.uniform(1, 2)])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Surface(corners * size / 2, faces, corners / 3**0.5, corners[:, :2] * 0.23 + 0.49)


def prism(random: Random) -> Surface:
    """A star or a polygon, extruded: n-gons, often concave, with flat normals."""
    points = random.randint(3, 6)
    inner = random.choice([1.0, random.uniform(0.45, 0.9)])
    angle = np.arange(2 * points) * np.pi / points
    radius = np.where(np.arange(2 * points) % 2 == 0, 1.0, inner)
    if inner == 1.0:
        angle, radius = angle[::2], radius[::2]
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    half = random.uniform(0.2, 0.8)
    count = len(rim)
    vertices, normals, faces = [], [], []
    for z, order in ((half, range(count)), (-half, reversed(range(count)))):
        faces.append(tuple(len(vertices) + k for k in order))
        vertices += [(*p, z) for p in rim]
        normals += [(0, 0, np.sign(z))] * count
    for k in range(count):
        a, b = rim[k], rim[(k + 1) % count]
        out = np.array([b[1] - a[1], a[0] - b[0], 0]) / np.hypot(*(b - a))
        faces.append(tuple(range(len(vertices), len(vertices) + 4)))
        vertices += [(*a, half), (*a, -half), (*b, -half), (*b, half)]
        normals += [tuple(out)] * 4
    points3 = np.array(vertices)
    return Surface(points3, tuple(faces), np.array(normals), points3[:, :2] * 0.31 + 0.49)


def hills(random: Random) -> Surface:
    """A height field of quads, none of them planar, with the normals of its formula."""
    count = random.randint(3, 7)
    a, b, c = random.uniform(1, 3), random.uniform(1, 3), random.uniform(0.1, 0.4)
    t = np.linspace(-1, 1, count + 1)
    x, z = (grid.ravel() for grid in np.meshgrid(t, t))
    y = c * np.sin(a * x) * np.cos(b * z)
    slope = np.stack(
        [-c * a * np.cos(a * x) * np.cos(b * z), np.ones_like(x), c * b * np.sin(a * x) * np.sin(b * z)], 1
    )
    at = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    return Surface(
        np.stack([x, y, z], axis=1),
        tuple(tuple(map(int, quad)) for quad in quads),
        slope / np.linalg.norm(slope, axis=1, keepdims=True),
        np.stack([x, z], axis=1) * 0.43 + 0.49,
    )


def plate(random: Random) -> Surface:
    """One planar polygon in y = 0, whose corners have normals of their own, up to 30 degrees off its own."""
    count = random.randint(4, 8)
    angle = (
        (np.arange(count) + np.array([random.uniform(-0.3, 0.3) for _ in range(count)])) * 2 * np.pi / count
    )
    radius = np.array([random.uniform(0.5, 1.2) for _ in range(count)])
    x, z = radius * np.cos(angle), radius * np.sin(angle)
    tilt = np.array([[random.uniform(-0.4, 0.4), 1, random.uniform(-0.4, 0.4)] for _ in range(count)])
    face = tuple(reversed(range(count)))
    normals = tilt / np.linalg.norm(tilt, axis=1, keepdims=True)
    return Surface(np.stack([x, 0 * x, z], axis=1), (face,), normals, np.stack([x, z], axis=1) * 0.31 + 0.49)


SURFACES: tuple[Callable[[Random], Surface], ...] = (ball, crate, slab, prism, hills, plate)
PLANAR = (ball, crate, slab, prism, plate)
"""Those whose polygons are all planar."""
FLAT = (crate, prism)
"""Those whose normals are their polygons' own."""


def colored(surface: Surface, random: Random) -> Surface:
    """The surface with a random colour at every vertex."""
    values = [[random.randrange(256) for _ in range(3)] for _ in surface.vertices]
    return replace(surface, colors=np.array(values, np.uint8))


# --- as files ----------------------------------------------------------------------------------------------


def obj(surface: Surface) -> bytes:
    """Wavefront OBJ: positions that occur twice are written once, as most exporters do."""
    where, lines = {}, []
    place = [where.setdefault(tuple(p), len(where)) for p in surface.vertices.tolist()]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in where]
    if surface.uvs is not None:
        lines += [f"vt {u!r} {v!r}" for u, v in surface.uvs.tolist()]
    if surface.normals is not None:
        lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in surface.normals.tolist()]

    def corner(v: int) -> str:
        uv = "" if surface.uvs is None else v + 1
        return f"{place[v] + 1}/{uv}" + ("" if surface.normals is None else f"/{v + 1}")

    lines += ["f " + " ".join(corner(v) for v in face) for face in surface.faces]
    return ("\n".join(lines) + "\n").encode()


def ply(surface: Surface, text: bool = True) -> bytes:
    """PLY with float properties, text or little-endian; colours as bytes."""
    columns = [("x y z", surface.vertices), ("nx ny nz", surface.normals), ("s t", surface.uvs)]
    there = [(names.split(), values) for names, values in columns if values is not None]
    head = ["ply", f"format {'ascii' if text else 'binary_little_endian'} 1.0"]
    head += [f"element vertex {len(surface.vertices)}"]
    head += [f"property float {name}" for names, _ in there for name in names]
    colors = surface.colors
    if colors is not None:
        head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    head += [f"element face {len(surface.faces)}", "property list uchar int vertex_indices", "end_header"]
    floats = np.concatenate([values for _, values in there], axis=1)
    if text:
        lines = [
            " ".join([*map(repr, row), *(() if colors is None else map(str, colors[k]))])
            for k, row in enumerate(floats.tolist())
        ]
        lines += [" ".join(map(str, (len(face), *face))) for face in surface.faces]
        return ("\n".join([*head, *lines]) + "\n").encode()
    body = b""
    for k, row in enumerate(floats.tolist()):
        body += struct.pack(f"<{len(row)}f", *row) + (b"" if colors is None else bytes(colors[k].tolist()))
    for face in surface.faces:
        body += struct.pack(f"<B{len(face)}i", len(face), *face)
    return ("\n".join(head) + "\n").encode() + body


def stl(surface: Surface) -> bytes:
    """Binary STL of triangles; the normals of the file count for nothing and are left 0."""
    body = b"\0" * 80 + struct.pack("<I", len(surface.faces))
    for face in surface.faces:
        body += struct.pack("<12fH", 0, 0, 0, *surface.vertices[list(face)].ravel(), 0)
    return body


def _gltf(surface: Surface) -> tuple[dict, bytes]:
    arrays = {"POSITION": surface.vertices, "NORMAL": surface.normals, "TEXCOORD_0": surface.uvs}
    if surface.uvs is not None:  # v runs downwards there
        arrays["TEXCOORD_0"] = surface.uvs * [1, -1] + [0, 1]
    data, views, accessors, attributes = b"", [], [], {}
    for name, values in arrays.items():
        if values is None:
            continue
        attributes[name] = len(accessors)
        kind = f"VEC{values.shape[1]}"
        more = {"min": values.min(0).tolist(), "max": values.max(0).tolist()} if name == "POSITION" else {}
        accessors.append(
            {"bufferView": len(views), "componentType": 5126, "count": len(values), "type": kind, **more}
        )
        raw = values.astype("<f4").tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        data += raw
    indices = np.array(surface.faces, "<u4")
    accessors.append(
        {"bufferView": len(views), "componentType": 5125, "count": indices.size, "type": "SCALAR"}
    )
    views.append({"buffer": 0, "byteOffset": len(data), "byteLength": indices.nbytes})
    data += indices.tobytes()
    about = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": len(accessors) - 1}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    return about, data


def gltf(surface: Surface) -> bytes:
    """glTF of triangles, as text with its buffer inside; without colours."""
    about, data = _gltf(surface)
    about["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return json.dumps(about).encode()


def glb(surface: Surface) -> bytes:
    """The same in one binary file."""
    about, data = _gltf(surface)
    text = json.dumps(about).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


WRITERS: dict[str, Callable[[Surface], bytes]] = {
    "obj": obj,
    "ply": ply,
    "bin.ply": lambda surface: ply(surface, text=False),
    "stl": stl,
    "gltf": gltf,
    "glb": glb,
}
"""By the end of a file's name. STL and glTF hold triangles alone, STL neither normals nor uv, and only PLY
colours."""


def shape_of(surface: Surface) -> dict:
    """The surface as a scene writes it out, without uv and colours."""
    made = {
        "shape": "polygons",
        "vertices": surface.vertices.tolist(),
        "faces": [list(face) for face in surface.faces],
    }
    return made if surface.normals is None else made | {"normals": surface.normals.tolist()}
