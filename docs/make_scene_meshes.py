"""Writes the meshes of scenes/meshes.

A sponge, a block of houses, gears, a terrain with vertex colours, and a ridged ball with baked obscurance.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import illumcli as illum

FOLDER = Path(__file__).parents[1] / "scenes" / "meshes"
SIDES = (  # axis, towards which end, and the corners of a unit cube's side, counter-clockwise from outside
    (0, 1, ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1))),
    (0, -1, ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0))),
    (1, 1, ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0))),
    (1, -1, ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))),
    (2, 1, ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))),
    (2, -1, ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))),
)


def write_obj(name: str, faces: NDArray[np.float64]) -> None:
    """(F, K, 3) faces as an OBJ file with shared vertices."""
    vertices, corners = np.unique(faces.reshape(-1, 3).round(4), axis=0, return_inverse=True)
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in vertices]
    lines += ["f " + " ".join(map(str, face + 1)) for face in corners.reshape(faces.shape[:2])]
    (FOLDER / f"{name}.obj").write_text("\n".join(lines) + "\n")


def sponge(level: int) -> NDArray[np.float64]:
    """Menger's sponge in the unit cube: cubes without their middles, again and again; outer faces alone."""
    solid = np.ones((1, 1, 1), bool)
    middle = np.add.outer(np.add.outer(*[np.array([0, 1, 0])] * 2), np.array([0, 1, 0])) < 2
    for _ in range(level):
        solid = np.kron(middle, solid)
    cubes = np.argwhere(solid)
    padded = np.pad(solid, 1)
    faces = []
    for axis, end, corners in SIDES:
        beside = cubes + 1
        beside[:, axis] += end
        open_ones = cubes[~padded[tuple(beside.T)]]
        faces.append(open_ones[:, None] + np.array(corners))
    return np.concatenate(faces) / len(solid) - 0.5


def block() -> NDArray[np.float64]:
    """Houses of a block of 10 by 10, some with a smaller house on their roof; without floors."""
    random = np.random.default_rng(7)
    faces = []
    for x, z in np.ndindex(5, 5):
        low = np.array([2 * x - 5 + 0.25, 0, 2 * z - 5 + 0.25])
        size = np.array([1.5, 0.5 + 2.2 * random.random() ** 2 + 1.6 * (random.random() < 0.16), 1.5])
        while size[1] > 0.2:
            faces += [
                low + size * np.array(corners) for axis, end, corners in SIDES if (axis, end) != (1, -1)
            ]
            shrink = random.uniform(0.45, 0.8)
            aside = random.uniform(0.15, 0.85, 2) * (1 - shrink)
            low = low + size * np.array([aside[0], 1, aside[1]])
            size = size * np.array([shrink, 0.35 * (random.random() < 0.6), shrink])
    return np.array(faces)


def gear(teeth: int) -> NDArray[np.float64]:
    """A gear of module 0.1 about the z axis, half as thick as 0.3, with a bore."""
    pitch = 0.05 * teeth
    shape = np.array([(-0.3, -0.12), (-0.17, 0.0), (-0.09, 0.1), (0.09, 0.1), (0.17, 0.0), (0.3, -0.12)])
    angle = (2 * np.pi / teeth * (np.arange(teeth)[:, None] + shape[:, 0])).ravel()
    rim = (pitch + np.tile(shape[:, 1], teeth))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    web = (pitch - 0.24) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    bore = 0.14 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # From the bore outwards along the front, around the rim, and back: the web is thinner than rim and hub.
    hub = 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    section = [(bore, 0.17), (hub, 0.17), (hub, 0.08), (web, 0.08), (web, 0.15), (rim, 0.15)]
    section += [(line, -z) for line, z in reversed(section)]
    rings = np.array([np.column_stack([line, np.full(len(line), z)]) for line, z in section])
    after = np.roll(rings, -1, axis=0)
    return np.stack([rings, after, np.roll(after, -1, axis=1), np.roll(rings, -1, axis=1)], axis=2).reshape(
        -1, 4, 3
    )


def terrain(side: int) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Vertices of hills over a square of 2 by 2, and their colours by height and slope."""
    random = np.random.default_rng(16)
    x, z = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    y = np.zeros_like(x)
    for octave in range(5):
        wave = 1.3 * 2.0**octave
        for turn in random.uniform(0, 2 * np.pi, 5):
            along = wave * (x * np.cos(turn) + z * np.sin(turn)) + random.uniform(0, 6)
            y += 0.16 / wave**0.95 * (1 - 1.6 * np.abs(np.sin(along)))
    y = np.maximum(y - np.quantile(y, 0.3), 0)
    steep = np.hypot(*np.gradient(y, 2 / (side - 1)))
    stops = [0, 1e-4, 0.04, 0.16, 0.27, 0.36, 1]
    colors = [
        (38, 88, 128),
        (196, 178, 128),
        (96, 128, 62),
        (74, 104, 52),
        (118, 104, 92),
        (240, 242, 246),
        (240, 242, 246),
    ]
    rgb = np.stack([np.interp(y, stops, channel) for channel in np.transpose(colors)], axis=-1)
    rock = np.clip((steep - 0.9) * 1.6, 0, 1)[..., None] * (y > 0.02)[..., None]
    rgb = rgb * (1 - rock) + np.array([122, 106, 94]) * rock
    return np.stack([x, y, z], axis=-1), rgb.round().astype(np.uint8)


def write_ply(name: str, points: NDArray[np.float64], colors: NDArray[np.uint8]) -> None:
    """A grid of points as a binary PLY with vertex colours."""
    side = len(points)
    head = f"""ply
format binary_little_endian 1.0
element vertex {side * side}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face {(side - 1) ** 2}
property list uchar ushort vertex_indices
end_header
"""
    vertices = np.zeros(side * side, [("p", "<f4", 3), ("c", "u1", 3)])
    vertices["p"], vertices["c"] = points.reshape(-1, 3), colors.reshape(-1, 3)
    number = np.arange(side * side).reshape(side, side)
    faces = np.zeros((side - 1) ** 2, [("n", "u1"), ("v", "<u2", 4)])
    quads = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    faces["n"], faces["v"] = 4, np.stack(quads, axis=-1).reshape(-1, 4)
    (FOLDER / f"{name}.ply").write_bytes(head.encode() + vertices.tobytes() + faces.tobytes())


def ridges() -> dict[str, object]:
    """A scene of a ball with three twisted ridges."""
    radius = "(1 + 0.24*sin(3*u + 4*cos(v))*sin(v)**2)"
    ball = {
        "shape": "parametric",
        "x": f"sin(v)*cos(u)*{radius}",
        "y": f"-0.95*cos(v)*{radius}",
        "z": f"-sin(v)*sin(u)*{radius}",
        "u": [0, 2 * np.pi],
        "v": [0, np.pi],
        "resolution": [72, 30],
    }
    return {"version": 1, "objects": [{"name": "ridges", "mesh": ball}]}


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    write_obj("sponge", sponge(2))
    write_obj("block", block())
    for teeth in (12, 18, 30):
        write_obj(f"gear{teeth}", gear(teeth))
    write_ply("terrain", *terrain(60))
    illum.bake(ridges(), FOLDER / "ridges.ply", samples=4096, ground="y", force=True)
