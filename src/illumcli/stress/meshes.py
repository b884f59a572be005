"""Invariance: the same surface in different files has the same w; an image is the same for any threads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.stress.rays import icosphere
from illumcli.stress.sandbox import CheckResult, Sandbox
from illumcli.stress.scenes import BALL, FLOOR, scene

Faces = NDArray[np.int64]
RAYS = 32
"""Rays per pixel. Embree rounds a hit on a reversed face differently, by 1e-8 radii, so that occasionally a
ray passes an edge on the other side."""


def check_meshes(sandbox: Sandbox, quick: bool) -> list[CheckResult]:
    """Different files of the same surface, and numbers of threads."""
    film = {"width": 40, "height": 30, "samples": 1} if quick else {"width": 320, "height": 240, "samples": 1}
    return [*_written(sandbox, film), _threads(sandbox, film, quick)]


def variants(vertices: NDArray[np.float64], faces: Faces) -> dict[str, tuple[NDArray[np.float64], Faces]]:
    """The same surface as other files might contain it."""
    random = np.random.default_rng(3)
    order = random.permutation(len(faces))
    shuffled = random.permutation(len(vertices))
    new_number = np.argsort(shuffled)
    flat = np.repeat(random.integers(len(vertices), size=(1000, 1)), 3, axis=1)
    return {
        "every face twice": (vertices, np.concatenate([faces, faces])),
        "every face and its reverse": (vertices, np.concatenate([faces, faces[:, ::-1]])),
        "faces reversed": (vertices, faces[:, ::-1]),
        "faces shuffled": (vertices, faces[order]),
        "vertices shuffled": (vertices[shuffled], new_number[faces]),
        "padded with 1000 faces without area": (vertices, np.concatenate([faces, flat])),
        "padded with 1000 unused vertices": (np.concatenate([vertices, np.zeros((1000, 3))]), faces),
        "vertices not shared": (vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)),
    }


def _written(sandbox: Sandbox, film: dict[str, int]) -> list[CheckResult]:
    # Two bodies close to each other, so that w varies.
    ball = icosphere(3)
    vertices, faces = (
        ball.vertices * [1, 0.7, 0.4] + [0.1, 0.2, 0.3],
        ball.corners.reshape(-1, 3).astype(np.int64),
    )
    second = vertices[:, [1, 2, 0]] * 0.6 + [0.9, 0.1, 0.2]
    vertices, faces = np.concatenate([vertices, second]), np.concatenate([faces, faces + len(vertices)])

    # Each variant against the original.
    reference = _w(sandbox, vertices, faces, film)
    results = []
    for name, (v, f) in variants(vertices, faces).items():
        other = _w(sandbox, v, f, film)
        different = int(np.count_nonzero(other != reference))
        apart = float(np.abs(other - reference).max())
        worst = f"{different} of {reference.size} pixels, by {apart:.2g}"
        if "revers" in name:
            check = f"w within 2/{RAYS} of all, the same bits in all but 0.1 %"
            passed = different <= 1e-3 * reference.size and apart <= 2.01 / RAYS
        else:
            check, passed = "w is the same bits", different == 0
        results.append(CheckResult(f"mesh: {name}", check, worst, passed))
    return results


def _w(
    sandbox: Sandbox, vertices: NDArray[np.float64], faces: Faces, film: dict[str, int]
) -> NDArray[np.float32]:
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
    text += "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
    thing = {"mesh": sandbox.file(f"mesh{sandbox.pictures}.obj", text.encode())}
    description = scene(thing, lights=[], film=film, obscurance={"samples": RAYS}, shading="constant")
    return sandbox.render(description, ("obscurance",))[0]["obscurance.Y"]


def _threads(sandbox: Sandbox, film: dict[str, int], quick: bool) -> CheckResult:
    description = {**scene(BALL, FLOOR), "film": film}
    reference = sandbox.render(description)[1]
    counts = (2, 3) if quick else (1, 2, 3, 4, 8, 8, 8)
    different = sum(sandbox.render(description, threads=threads)[1] != reference for threads in counts)
    check = f"threads {', '.join(map(str, sorted(set(counts))))}: the files are the same bytes"
    return CheckResult("threads", check, f"{different} of {len(counts)} files differ", different == 0)
