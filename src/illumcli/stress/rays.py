"""Rays at the limits of single precision: self-intersection, contact gaps, leaks, shadow terminators."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, column_major, cross, dot, take_rows, unit
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import SceneGeometry, place_meshes
from illumcli.geometry.transforms import rotation
from illumcli.rays.embree import Tracer
from illumcli.rays.interaction import SurfaceInteraction, interact
from illumcli.rays.offsets import offset_ray_origins
from illumcli.stress.sandbox import CheckResult, Sandbox
from illumcli.stress.scenes import scene

GAPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Gaps between floor and plate, in radii of the scene."""
SLIVERS_PPM = 20
"""Allowed self-intersections of a rotated needle; rounding of its vertices makes it slightly non-convex."""
EDGES_PPM = 1000
"""Allowed self-intersections near edges. A ray that starts within 4e-7 radii of a sharp edge may pass it by
less than Embree's tolerance and hit the face beyond. A longer offset would lose gaps of 1e-6 radii."""


def check_rays(sandbox: Sandbox, quick: bool) -> list[CheckResult]:
    """All checks of the tracer and of ray origins."""
    count = 20_000 if quick else 2_000_000
    return [
        *(row for name, mesh, away in _bodies() for row in _self_hits(name, mesh, away, count)),
        _gaps(2_000 if quick else 100_000),
        *_leaks(3 if quick else 6, 20_000 if quick else 1_000_000),
        *_terminators(sandbox, quick),
        _near_lights(sandbox),
    ]


def icosphere(divisions: int) -> Mesh:
    """A sphere of 20 * 4^divisions triangles with smooth normals."""
    # The icosahedron: all triples of vertices at the shortest distance, oriented outwards.
    g = (1 + 5**0.5) / 2
    points = np.array([[s * a, t * b, 0.0] for s in (1, -1) for t in (1, -1) for a, b in [(1, g)]])
    vertices = np.concatenate([np.roll(points, k, axis=1) for k in range(3)])
    apart = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = np.abs(apart - 2) < 1e-9
    triples = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = np.array(triples)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    inward = dot(cross(b - a, c - a), a + b + c) < 0
    triangles[inward] = triangles[inward][:, ::-1]

    # Split every triangle into four.
    for _ in range(divisions):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, number = np.unique(edges, axis=0, return_inverse=True)
        middle = number.reshape(-1, 3) + len(vertices)
        vertices = np.concatenate([vertices, vertices[edges].sum(axis=1)])
        parts = [[triangles[:, k], middle[:, k], middle[:, k - 1]] for k in range(3)]
        triangles = np.concatenate([*(np.stack(part, axis=1) for part in parts), middle])
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    corners = triangles.astype(np.int32)
    return Mesh.of_triangles(vertices, corners, normals=vertices.copy(), corner_normals=corners)


def _bodies() -> list[tuple[str, Mesh, float]]:
    from illumcli.geometry.shapes.box import Box

    ball, box = icosphere(5), Box().mesh()
    needle = Mesh.of_triangles(ball.vertices * [1, 1e-3, 1e-3], ball.corners)
    return [
        ("box", box, 0.0),
        ("ball of 20,480 faces", ball, 0.0),
        ("needle 1000:1", needle, 0.0),
        ("box of 1e-3 at distance 1", _scaled(box, 1e-3), 1.0),
        ("ball of 1e-3 at distance 1", _scaled(ball, 1e-3), 1.0),
    ]


def _scaled(mesh: Mesh, factor: float) -> Mesh:
    return Mesh(mesh.vertices * factor, mesh.corners, mesh.starts)


def world_of(mesh: Mesh, away: float = 0.0) -> SceneGeometry:
    """The mesh rotated about all axes and moved; with `away`, a speck at the origin enlarges the scene."""
    matrix = rotation(2, 23.0) @ rotation(1, 41.0) @ rotation(0, 17.0)
    matrix[:3, 3] = away
    if not away:
        return place_meshes([mesh], [matrix])
    speck = Mesh.of_triangles(-np.eye(3) * 1e-4 - away, [[0, 1, 2]])
    return place_meshes([mesh, speck], [matrix, np.eye(4)])


def surface_points(
    geometry: SceneGeometry, count: int, seed: int
) -> tuple[NDArray[np.float64], SurfaceInteraction]:
    """Points on object 0, one in four on an edge or vertex, and their surface interactions from outside."""
    random = np.random.default_rng(seed)
    of_object = np.flatnonzero(geometry.objects == 0).astype(np.int32)
    triangle = of_object[random.integers(len(of_object), size=count)]
    u, v = random.random((2, count)).astype(F)
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    u[: count // 4] = 0
    v[: count // 8] = random.integers(0, 2, count // 8)
    corners = [
        take_rows(geometry.vertices, geometry.triangles[triangle, k]).astype(np.float64) for k in range(3)
    ]
    outward = unit(column_major(cross(corners[1] - corners[0], corners[2] - corners[0])))
    interaction = interact(geometry, np.zeros_like(triangle), triangle, u, v, outward)
    return interaction.position, interaction


def grazing(n: NDArray[Any], seed: int) -> NDArray[np.float32]:
    """(N, 3) directions above the plane of each normal, half of them within 1e-6 to 1e-1 of the plane."""
    random = np.random.default_rng(seed)
    count = len(n)
    tangent = unit(column_major(cross(n, column_major(random.normal(size=(count, 3))))))
    height = np.where(random.random(count) < 0.5, 10 ** random.uniform(-6, -1, count), random.random(count))
    return column_major(np.sqrt(1 - height * height)[:, None] * tangent + height[:, None] * n, F)


def _self_hits(name: str, mesh: Mesh, away: float, count: int) -> list[CheckResult]:
    """A convex body never occludes rays from its own surface."""
    geometry = world_of(mesh, away)
    tracer = Tracer(geometry.vertices, geometry.triangles)
    limit = 0.5 if away else np.inf  # the speck is no part of the body
    hits, done = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for seed, first in enumerate(range(0, count, 1 << 18)):
        part = min(1 << 18, count - first)
        position, interaction = surface_points(geometry, part, seed)
        direction = grazing(interaction.ng.astype(np.float64), seed)
        # rounding moves some rays that are 1e-6 rad above the horizon below it; these start into the body
        up = dot(direction.astype(np.float64), interaction.ng.astype(np.float64)) > 1e-7
        origins = offset_ray_origins(position, interaction.ng, interaction.edge)
        hidden = tracer.occluded(column_major(origins[up]), column_major(direction[up]), limit)
        rim = np.flatnonzero(up) < part // 4
        for k, where in enumerate((~rim, rim)):
            hits[k] += np.count_nonzero(hidden & where)
            done[k] += np.count_nonzero(where)
    ppm = 1e6 * hits[1] / done[1]
    return [
        CheckResult(
            f"self-hits: {name}",
            "rays from faces, down to 1e-6 rad"
            + (f": at most {SLIVERS_PPM} ppm" if "needle" in name else ""),
            f"{hits[0]} of {done[0]:,} rays",
            bool(1e6 * hits[0] <= done[0] * SLIVERS_PPM) if "needle" in name else not hits[0],
        ),
        CheckResult(
            f"self-hits at edges: {name}",
            f"rays from edges and vertices: at most {EDGES_PPM} ppm",
            f"{ppm:.0f} ppm of {done[1]:,} rays",
            bool(ppm <= EDGES_PPM),
        ),
    ]


def _gaps(count: int) -> CheckResult:
    """A plate above a floor shadows all points below it, at any gap."""
    random = np.random.default_rng(5)
    lit: dict[float, float] = {}
    square = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float64)
    quads = [[0, 2, 1], [0, 3, 2]]
    for gap in GAPS:
        # A floor and, parallel above it, a plate of half its size; the scene's radius is the root of 2.
        floor = Mesh.of_triangles(square + np.array([0.2, 0.7, 0.1]), quads)
        plate = Mesh.of_triangles(square * 0.5 + [0.2, 0.7 + gap * 2**0.5, 0.1], quads)
        geometry = world_of(Mesh.of_triangles(
            np.concatenate([floor.vertices, plate.vertices]), [*quads, *(np.array(quads) + 4)]
        ))  # fmt: skip
        tracer = Tracer(geometry.vertices, geometry.triangles)
        # Rays from random points of the floor under the plate, along its normal: each must hit the plate.
        weight = random.uniform(0.3, 0.7, (count, 2))  # of the floor's square, under the plate
        corner = [geometry.vertices[k].astype(np.float64) for k in range(4)]
        position = column_major(
            corner[0] + weight[:, :1] * (corner[1] - corner[0]) + weight[:, 1:] * (corner[3] - corner[0])
        )
        up = unit(column_major(np.cross(corner[3] - corner[0], corner[1] - corner[0])[None]))
        n = column_major(np.repeat(up, count, axis=0), F)
        origins = offset_ray_origins(position, n, np.full(count, np.linalg.norm(corner[2] - corner[0]), F))
        hidden = tracer.occluded(origins, n)
        lit[gap] = float(np.mean(~hidden))
    worst = max(lit, key=lambda gap: lit[gap])
    return CheckResult(
        "contact gaps",
        f"a plate {GAPS[0]:g} to {GAPS[-1]:g} radii over a floor shades it",
        f"{lit[worst]:.2%} of rays pass, gap {worst:g}",
        not any(lit.values()),
    )


def _leaks(divisions: int, count: int) -> list[CheckResult]:
    """No ray from inside leaves a closed mesh, through faces, edges or vertices."""
    geometry = world_of(icosphere(divisions))
    tracer = Tracer(geometry.vertices, geometry.triangles)
    random = np.random.default_rng(9)
    results = []
    for aim in ("faces", "edges", "vertices"):
        missed = done = 0
        for first in range(0, count, 1 << 18):
            part = min(1 << 18, count - first)
            inside = column_major(random.uniform(-0.3, 0.3, (part, 3)), F)
            triangle = random.integers(len(geometry.triangles), size=part)
            a, b, c = (
                geometry.vertices[geometry.triangles[triangle, k]].astype(np.float64) for k in range(3)
            )
            u, v = random.random((2, part, 1)) / 2
            target = {"faces": a + u * (b - a) + v * (c - a), "edges": a + u * 2 * (b - a), "vertices": a}[
                aim
            ]
            closest = tracer.closest(inside, column_major(unit(column_major(target - inside)), F))
            missed, done = missed + int(np.count_nonzero(closest.triangle < 0)), done + part
        check = f"from inside a closed ball of {len(geometry.triangles):,} faces"
        results.append(CheckResult(f"leaks at {aim}", check, f"{missed} of {done:,} rays", not missed))
    return results


def _terminators(sandbox: Sandbox, quick: bool) -> list[CheckResult]:
    """A single smooth sphere has no shadow on its lit side, however coarse its mesh is."""
    results = []
    film = {"width": 48, "height": 48, "samples": 1} if quick else {"width": 256, "height": 256, "samples": 1}
    for divisions in (1, 3) if quick else (1, 2, 3, 5):
        # A ball whose vertex normals are those of the sphere.
        mesh = icosphere(divisions)
        text = "".join(f"v {x!r} {y!r} {z!r}\nvn {x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist())
        text += "".join(
            f"f {a}//{a} {b}//{b} {c}//{c}\n" for a, b, c in (mesh.corners.reshape(-1, 3) + 1).tolist()
        )
        ball = {"mesh": sandbox.file(f"ball{divisions}.obj", text.encode())}
        to_light = np.array([2.0, 1.0, 0.5]) / np.sqrt(5.25)
        sun = {"light": "directional", "name": "sun", "direction": (-to_light).tolist()}
        channels, _ = sandbox.render(
            scene(ball, lights=[sun], film=film, camera={"position": [0, 0.5, 4], "target": [0, 0, 0]}),
            ("shadows", "normal", "obscurance", "alpha"),
        )
        # Where the shading normal faces the light, a convex body is neither in shadow nor obscured.
        n_l = sum(channels[f"N.{axis}"] * component for axis, component in zip("XYZ", to_light, strict=True))
        lit = (channels["A"] == 1) & (n_l > 1e-5)
        false = int(np.count_nonzero(channels["shadow.sun.Y"][lit] != 1))
        closed = int(np.count_nonzero(channels["obscurance.Y"][channels["A"] == 1] != 1))
        results.append(
            CheckResult(
                f"terminator: ball of {20 * 4**divisions:,} faces",
                "no false shadow on the lit side, w = 1",
                f"{false} of {np.count_nonzero(lit)} lit pixels, {closed} with w < 1",
                not false and not closed,
            )
        )
    return results


def _near_lights(
    sandbox: Sandbox, heights: Sequence[float] = (0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-4, 1e-2)
) -> CheckResult:
    """A light on one side of a plane casts no shadow on that side, however near it is."""
    plane = {"mesh": {"shape": "plane", "size": [2, 2]}}
    lamps = [
        {"light": "point", "name": f"h{i}", "position": [0.013, height, 0.017]}
        for i, height in enumerate(heights)
    ]
    film = {"width": 64, "height": 64, "samples": 1}
    camera = {"position": [0, 2, 0.5], "target": [0, 0, 0]}
    channels, _ = sandbox.render(
        scene(plane, lights=lamps, film=film, camera=camera), ("shadows", "lights", "alpha")
    )
    wrong = 0
    for i in range(1, len(heights)):
        lit = (channels["A"] == 1) & (channels[f"shadow.h{i}.Y"] == 0)
        wrong += int(np.count_nonzero(lit & (heights[i] > 1e-6)))
    brightest = max(float(values.max()) for name, values in channels.items() if name.startswith("h"))
    return CheckResult(
        "light near a plane",
        f"{len(heights)} heights of {heights[0]:g} to {heights[-1]:g} radii: no false shadow, finite",
        f"{wrong} pixels in shadow, brightest {brightest:.2g}",
        not wrong and bool(np.isfinite(brightest)),
    )
