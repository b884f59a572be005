"""A slow renderer in double precision, written apart from the package, to compare single precision with.

Its rays come from the camera's definition, its hits and shadows from the intersection test of Möller and
Trumbore (1997) with every triangle, its light from the lamps' definition, all in float64 on the mesh as
given, not recentred, without offsets. Of the package it takes the formulas of the models, which 50-digit
vectors check in double precision, and the directions of obscurance rays, so that both look the same way.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

LAYERS = (
    "beauty", "diffuse", "specular", "ambient", "shadows", "obscurance", "depth", "position", "normal",
    "geometric_normal", "triangle_id",
)  # fmt: skip
SELF = 1e-9
"""Hits nearer than this to where a secondary ray starts are its own surface [scene radii]."""


@dataclass(frozen=True)
class Setup:
    """One mesh, one material, one lamp, one camera."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    material: dict
    lamp: tuple
    camera: dict
    width: int = 48
    height: int = 36
    rays: int = 16

    def write(self, folder: Path) -> Path:
        """The same as a scene file."""
        text = "".join(
            f"v {x!r} {y!r} {z!r}\nvn {a!r} {b!r} {c!r}\n"
            for (x, y, z), (a, b, c) in zip(self.vertices.tolist(), self.normals.tolist(), strict=True)
        )
        text += "".join(f"f {a}//{a} {b}//{b} {c}//{c}\n" for a, b, c in (self.faces + 1).tolist())
        (folder / f"{self.name}.obj").write_text(text)
        scene = {
            "version": 1,
            "camera": self.camera,
            "film": {"width": self.width, "height": self.height, "samples": 1},
            "ambient": 0.4,
            "obscurance": {"samples": self.rays},
            "objects": [{"mesh": f"{self.name}.obj", "material": self.material}],
            "lights": [{"light": "point", "name": "key", "position": list(self.lamp), "intensity": 20}],
            "outputs": {"layers": list(LAYERS), "colour": "float"},
        }
        path = folder / f"{self.name}.yaml"
        path.write_text(json.dumps(scene))
        return path


def unit(a):
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def intersect(setup, o, d, least=0.0, most=np.inf):
    """Number of the nearest triangle of each ray (-1: none), its t, u and v: Möller and Trumbore."""
    v0, v1, v2 = (setup.vertices[setup.faces[:, k]] for k in range(3))
    e1, e2 = v1 - v0, v2 - v0
    number, best, bu, bv = np.full(len(o), -1), np.full(len(o), np.inf), np.zeros(len(o)), np.zeros(len(o))
    for first in range(0, len(o), 4096):
        part = slice(first, first + 4096)
        oo, dd = o[part, None], d[part, None]
        p = np.cross(dd, e2[None])
        det = (e1 * p).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = oo - v0
            u = (s * p).sum(-1) / det
            q = np.cross(s, e1[None])
            v = (dd * q).sum(-1) / det
            t = (e2 * q).sum(-1) / det
            hit = (
                (u >= 0)
                & (v >= 0)
                & (u + v <= 1)
                & (t > least)
                & (t < np.broadcast_to(most, len(o))[part, None])
            )
        t = np.where(hit, t, np.inf)
        nearest = t.argmin(axis=1)
        row = np.arange(len(t))
        found = np.isfinite(t[row, nearest])
        number[part] = np.where(found, nearest, -1)
        best[part], bu[part], bv[part] = t[row, nearest], u[row, nearest], v[row, nearest]
    return number, best, bu, bv


def render(setup):
    """Channel -> (H, W) float64, as the package names them."""
    from illumcli.rays.sampling import dither, spiral_table, stream
    from illumcli.scene.spec import Scene
    from illumcli.shading.terms import evaluate
    from illumcli.visibility.hemisphere import turned_frame

    eye, target = (np.asarray(setup.camera[k], float) for k in ("position", "target"))
    forward = unit(target - eye)
    right = unit(np.cross(forward, [0.0, 1.0, 0.0]))
    up = np.cross(right, forward)
    y, x = np.divmod(np.arange(setup.width * setup.height), setup.width)
    slope = np.tan(np.radians(setup.camera["fov"]) / 2)
    a = slope * (2 * (x + 0.5) - setup.width) / setup.height
    b = slope * (1 - 2 * (y + 0.5) / setup.height)
    d = unit(forward + a[:, None] * right + b[:, None] * up)
    number, t, u, v = intersect(setup, np.broadcast_to(eye, d.shape), d)
    seen = np.flatnonzero(number >= 0)
    number, t, u, v, d = number[seen], t[seen], u[seen], v[seen], d[seen]
    corner = setup.faces[number]
    position = eye + t[:, None] * d
    weight = np.stack([1 - u - v, u, v], axis=1)
    v0, v1, v2 = (setup.vertices[corner[:, k]] for k in range(3))
    ng = unit(np.cross(v1 - v0, v2 - v0))
    behind = (ng * d).sum(1) > 0
    n = unit((weight[:, :, None] * setup.normals[corner]).sum(1))
    ng[behind], n[behind] = -ng[behind], -n[behind]

    way = np.asarray(setup.lamp) - position
    distance = np.linalg.norm(way, axis=1)
    l = way / distance[:, None]
    lit = (n * l).sum(1) > 0
    radius = np.linalg.norm(np.ptp(setup.vertices, axis=0)) / 2
    # Hanika's point: the mean of the projections on the corners' tangent planes, where that lies outside
    offset_ray_origins = position.copy()
    for k in range(3):
        normal = setup.normals[corner[:, k]] * np.where(behind, -1, 1)[:, None]
        below = np.minimum(((position - setup.vertices[corner[:, k]]) * normal).sum(1), 0)
        offset_ray_origins -= (weight[:, k] * below)[:, None] * normal
    # lit is what the polygon's own ray says, or the ray from that point where nothing lies on the way to it
    # and nothing of the other body stands nearby
    tiny = SELF * radius
    start, height = position + tiny * ng, np.linalg.norm(offset_ray_origins - position, axis=1)
    own, *_ = intersect(setup, start, l, tiny, distance - tiny)
    implied, *_ = intersect(setup, offset_ray_origins + tiny * ng, l, tiny, distance - tiny)
    up = (offset_ray_origins - position) / np.maximum(height, 1e-300)[:, None]
    way, *_ = intersect(setup, start, up, tiny, height - tiny)
    along = unit(l - np.minimum((l * ng).sum(1), 0)[:, None] * ng)
    width = np.linalg.norm(np.ptp(setup.vertices[corner], axis=1), axis=1)
    near, *_ = intersect(setup, start, along, tiny, np.minimum(2 * width, distance - tiny))
    body = len(setup.faces) // 2
    alone = (near < 0) | (near // body == number // body)
    delta = (lit & ((own < 0) | ((height > 0) & (implied < 0) & (way < 0) & alone))).astype(float)

    model = Scene.model_validate({"version": 1, "materials": {"m": setup.material}}).materials["m"]
    given = {name: np.asfortranarray(value[lit]) for name, value in (("n", n), ("l", l), ("v", -d))}
    lobes = evaluate(model.lobes(), given)
    light = {}
    for name in ("diffuse", "specular"):
        light[name] = np.zeros((len(seen), 3))
        if name in lobes:
            light[name][lit] = lobes[name] * (20 / distance[lit] ** 2 * delta[lit])[:, None]

    draws = dither(stream(0, "obscurance"), x[seen], y[seen], np.zeros(len(seen), int))
    table = spiral_table(setup.rays).astype(float).transpose(0, 2, 1)
    pattern = table[(draws[1] * len(table)).astype(int)]
    frame = turned_frame(np.asfortranarray(n.astype(np.float32)), (2 * np.pi * draws[0]).astype(np.float32))
    ways = np.matmul(pattern, frame.astype(float)).reshape(-1, 3)
    plane = np.repeat(ng, setup.rays, axis=0)
    ways -= 2 * np.minimum((ways * plane).sum(1), 0)[:, None] * plane
    starts = np.repeat(position + SELF * radius * ng, setup.rays, axis=0)
    closed, *_ = intersect(setup, starts, ways, SELF * radius)
    w = (closed < 0).reshape(-1, setup.rays).mean(axis=1)
    ambient = np.broadcast_to(model.ambient_color(), (len(seen), 3)) * 0.4 * w[:, None]

    out = {
        "Z": ((position - eye) * forward).sum(1), "obscurance.Y": w, "shadow.key.Y": delta,
        "triangleId.Y": number + 1.0,
    }  # fmt: skip
    for prefix, value in (
        ("", light["diffuse"] + light["specular"] + ambient), ("diffuse.", light["diffuse"]),
        ("specular.", light["specular"]), ("ambient.", ambient),
    ):  # fmt: skip
        out |= {f"{prefix}{c}": value[:, k] for k, c in enumerate("RGB")}
    for prefix, value in (("P", position), ("N", n), ("Ng", ng)):
        out |= {f"{prefix}.{c}": value[:, k] for k, c in enumerate("XYZ")}
    whole = {}
    for name, values in out.items():
        whole[name] = np.zeros(setup.width * setup.height)
        whole[name][seen] = values
        whole[name] = whole[name].reshape(setup.height, setup.width)
    return whole


@dataclass(frozen=True)
class Difference:
    """How far a layer of the package's picture is from the reference."""

    layer: str
    pixels: int
    largest: float  # of |float32 - float64| over the layer's largest value
    rms: float  # of the same


def compare(setup, folder):
    """A row per layer, over the pixels whose every ray answered alike, and the counts of those left out."""
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene
    from illumcli.images.reader import read_image

    image = folder / f"{setup.name}.exr"
    render_scene(RenderJob(setup.write(folder), RenderOptions(pattern=str(image), cache=False)))
    single, double = read_image(image).channels, render(setup)
    hits = single["triangleId.Y"] == double["triangleId.Y"]
    shadows = single["shadow.key.Y"] == double["shadow.key.Y"]
    open_ = np.abs(single["obscurance.Y"] - double["obscurance.Y"]) < 0.5 / setup.rays
    alike = hits & shadows & open_ & (double["triangleId.Y"] > 0)
    layers = {}
    for name in single:
        prefix = name.rpartition(".")[0] or ("beauty" if name in "RGB" else name)
        if name not in ("A",) and not prefix.startswith("triangle"):
            layers.setdefault(prefix, []).append(name)
    rows = []
    for layer, names in layers.items():
        a = np.stack([single[name][alike].astype(float) for name in names])
        b = np.stack([double[name][alike] for name in names])
        scale = np.abs(b).max() or 1.0
        off = np.abs(a - b) / scale
        rows.append(Difference(layer, int(alike.sum()), float(off.max()), float(np.sqrt((off * off).mean()))))
    counts = {
        "seen": int((double["triangleId.Y"] > 0).sum()), "other triangle": int((~hits).sum()),
        "other shadow": int((hits & ~shadows).sum()), "other obscurance ray": int((hits & ~open_).sum()),
    }  # fmt: skip
    return rows, counts


def setups():
    """Two coarse smooth balls: three materials, then far from the origin, tiny, and flattened."""
    from illumcli.stress.rays import icosphere

    ball = icosphere(2)
    faces = ball.corners.reshape(-1, 3)
    two = np.concatenate([ball.vertices, ball.vertices * 0.5 + [1.2, 0.4, 0.5]])
    normals, both = (
        np.concatenate([ball.vertices, ball.vertices]),
        np.concatenate([faces, faces + len(ball.vertices)]),
    )
    matte = {"model": "lambert", "diffuse": [0.8, 0.6, 0.4]}
    shiny = {"model": "blinn_phong", "diffuse": 0.5, "specular": 0.5, "exponent": 200}
    metal = {"model": "cook_torrance", "diffuse": 0.5, "distribution": {"D": "beckmann", "m": 0.2}}
    camera = {"position": [2.0, 1.6, 3.4], "target": [0.4, 0.1, 0.1], "fov": 40.0}

    def moved(scale, away):
        return {**camera, **{k: [scale * x + away for x in camera[k]] for k in ("position", "target")}}

    def setup(name, material, scale=1.0, away=0.0, shape=(1, 1, 1)):
        vertices = two * shape * scale + away
        n = unit(normals / np.asarray(shape, float))
        lamp = tuple(scale * x + away for x in (2.5, 3.0, 2.0))
        return Setup(name, vertices, both, n, material, lamp, moved(scale, away))

    return [
        setup("matte", matte),
        setup("shiny", shiny),
        setup("metal", metal),
        setup("far", shiny, away=1e6),
        setup("tiny", shiny, scale=1e-6),
        setup("flat", shiny, shape=(1, 0.05, 1)),
    ]
