"""Do pictures of rough conductors agree with Mitsuba's?

Copper under one point light: Mitsuba 3's `roughconductor`, and `cook_torrance` with `masking: smith`.
Beckmann and GGX, isotropic and anisotropic, on the sphere and on MESH. Both renderers get the same triangles
with normals and uv (the grain is along x), and one ray through the centre of each pixel; nothing is random. A
row has the relative difference of lit pixels: median, 99th percentile, largest. Mitsuba has Beckmann's G1
by Walter's rational function: under `with its G1` our picture is multiplied by that G1 over the exact one.

    PEERS=/path/to/venv/bin/python PYTHONPATH=src python benchmarks/rough_conductors.py [--small] [MESH ...]

PEERS has `pip install mitsuba`, which wants an LLVM of 16 or later (DRJIT_LIBLLVM_PATH says where).
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from _bench import SMALL, header, illum, process
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.images.reader import read_image
from illumcli.mesh_files import read_mesh
from illumcli.models._masking import anisotropic_spread2, beckmann_area, smith_g1

SIZE = (48, 48) if SMALL else (512, 512)
EYE, LAMP, FOV = (0.0, 0.0, 4.0), (2.0, 3.0, 3.0), 35.0
COPPER_N, COPPER_K = (0.2004, 0.9240, 1.1022), (3.9129, 2.4528, 2.1421)
LIT = 1e-4
"""Pixels of less than this, of white 1, are not compared: shadows, and highlights' tails."""

SURFACES = {
    "beckmann 0.1": ("beckmann", 0.1, 0.1),
    "beckmann 0.5": ("beckmann", 0.5, 0.5),
    "beckmann 0.1 x 0.4": ("beckmann", 0.1, 0.4),
    "ggx 0.1": ("ggx", 0.1, 0.1),
    "ggx 0.5": ("ggx", 0.5, 0.5),
    "ggx 0.1 x 0.4": ("ggx", 0.1, 0.4),
}

MITSUBA = """
import sys
import drjit as dr
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
from mitsuba import ScalarTransform4f as T
distribution, alpha_u, alpha_v = sys.argv[1], *map(float, sys.argv[2:4])
width, height = %(size)r
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
    "sensor": {
        "type": "perspective", "fov": %(fov)r, "fov_axis": "y",
        "to_world": T().look_at(origin=%(eye)r, target=[0, 0, 0], up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": width, "height": height},
    },
    "lamp": {"type": "point", "position": %(lamp)r, "intensity": {"type": "rgb", "value": 10.0}},
    "mesh": {"type": "ply", "filename": "mesh.ply", "bsdf": {
        "type": "roughconductor", "distribution": distribution, "alpha_u": alpha_u, "alpha_v": alpha_v,
        "eta": {"type": "rgb", "value": %(n)r}, "k": {"type": "rgb", "value": %(k)r},
    }},
})
index = dr.arange(mi.UInt32, width * height)
film = mi.Point2f((mi.Float(index %% width) + 0.5) / width, (mi.Float(index // width) + 0.5) / height)
ray, _ = scene.sensors()[0].sample_ray(0, 0, film, mi.Point2f(0.5))
sampler = mi.load_dict({"type": "independent"})
sampler.seed(0, width * height)
color, _, _ = scene.integrator().sample(scene, sampler, ray)
hit = scene.ray_intersect(ray)
to_light = hit.to_local(dr.normalize(mi.Point3f(%(lamp)r) - hit.p))
for name, vectors in (("color", color), ("eye", hit.wi), ("light", to_light)):
    mi.Bitmap(mi.TensorXf(dr.ravel(vectors), (height, width, 3))).write(name + ".exr")
"""


def write_mesh(mesh: Mesh, path: Path) -> int:
    """Write triangles that share nothing, within radius 1, with smooth normals, u = x; returns how many."""
    counts, first = np.diff(mesh.starts), mesh.starts[:-1]
    fans = [
        mesh.corners[first[counts > k + 1][:, None] + np.array([0, k, k + 1])]
        for k in range(1, counts.max() - 1)
    ]
    triangles = np.concatenate(fans)
    middle = (mesh.vertices.min(0) + mesh.vertices.max(0)) / 2
    points = (mesh.vertices - middle) / np.linalg.norm(mesh.vertices - middle, axis=1).max()
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    triangles = triangles[np.linalg.norm(areas, axis=1) > 0]
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], areas[np.linalg.norm(areas, axis=1) > 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    corners = triangles.ravel()
    vertices = np.concatenate([points[corners], normals[corners], points[corners][:, :2]], axis=1).astype(
        "<f4"
    )
    faces = np.empty(len(triangles), [("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, np.arange(len(corners)).reshape(-1, 3)
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v"))
    path.write_bytes(
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{names}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n".encode()
        + vertices.tobytes() + faces.tobytes()
    )  # fmt: skip
    return len(triangles)


def rational_g1(cosine: np.ndarray, spread2: np.ndarray) -> np.ndarray:
    """Walter et al. (2007), eq. 27, as Mitsuba has it."""
    a = cosine / np.sqrt(np.maximum(spread2, 1e-20))
    fit = (3.535 * a + 2.181 * a * a) / (1 + 2.276 * a + 2.577 * a * a)
    return np.where(a < 1.6, fit, 1.0)


def our_picture(folder: Path, kind: str, alpha_x: float, alpha_y: float) -> np.ndarray:
    """(H, W, 3) radiance."""
    name = {"beckmann": "m", "ggx": "alpha"}[kind]
    across = f", {name}_y: {alpha_y}" if alpha_y != alpha_x else ""
    (folder / "ours.yaml").write_text(f"""\
version: 1
camera: {{position: {list(EYE)}, target: [0, 0, 0], fov: {FOV}}}
film: {{width: {SIZE[0]}, height: {SIZE[1]}, samples: 1, background: 0}}
terminator: none
materials:
  copper: {{model: cook_torrance, diffuse: 0, specular_weight: 1, masking: smith,
           distribution: {{D: {kind}, {name}: {alpha_x}{across}}},
           fresnel: {{F: conductor, n: {list(COPPER_N)}, k: {list(COPPER_K)}}}}}
objects: [{{mesh: mesh.ply, material: copper}}]
lights: [{{light: point, position: {list(LAMP)}, intensity: 10}}]
outputs: {{files: ["ours.exr"], colour: float}}
""")
    illum("render", "ours.yaml", "--force", "-q", cwd=folder)
    return picture(folder / "ours.exr")


def picture(path: Path) -> np.ndarray:
    """(H, W, 3)."""
    channels = read_image(path).channels
    return np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float64)


def compare(folder: Path, python: str, kind: str, alpha_x: float, alpha_y: float) -> list[str]:
    """The cells of a row."""
    ours = our_picture(folder, kind, alpha_x, alpha_y)
    process([python, "theirs.py", kind, str(alpha_x), str(alpha_y)], folder, PYTHONPATH="")
    reference, eye, light = (picture(folder / f"{name}.exr") for name in ("color", "eye", "light"))
    lit = (ours.max(-1) > LIT) & (reference.max(-1) > LIT)
    alone = ((ours.max(-1) > LIT) != (reference.max(-1) > LIT)).sum()
    cells = [f"{lit.sum():8d}", f"{alone:6d}", difference(ours[lit], reference[lit])]
    if kind == "beckmann":
        # Masking of light and eye as Mitsuba has it, over the exact one.
        factor = np.ones(lit.sum())
        for x in (eye[lit], light[lit]):
            spread2 = anisotropic_spread2(x[:, 0], x[:, 1], np.array(alpha_x), np.array(alpha_y))
            factor *= rational_g1(x[:, 2], spread2) / smith_g1(beckmann_area(x[:, 2], spread2))
        cells.append(difference(ours[lit] * factor[:, None], reference[lit]))
    return cells


def difference(ours: np.ndarray, reference: np.ndarray) -> str:
    """Relative to the reference's largest channel: median, 99th percentile, largest."""
    relative = np.abs(ours - reference).max(-1) / reference.max(-1)
    return "  ".join(f"{x:8.1e}" for x in (*np.percentile(relative, (50, 99)), relative.max()))


def main(meshes: list[str]) -> None:
    python = os.environ.get("PEERS")
    if python is None:
        sys.exit("set PEERS to the python of an environment with mitsuba")
    header("Do pictures of rough conductors agree with Mitsuba's?", film=f"{SIZE[0]}x{SIZE[1]}")
    print(f"# lit: pixels above {LIT} in both; alone: in one of the two")
    print(f"{'':32s} {'lit':>8s} {'alone':>6s} {'median  99th  largest':>28s} {'with its G1':>28s}")
    segments = {"segments": 32, "rings": 16} if SMALL else {"segments": 512, "rings": 256}
    sources = {"sphere": Sphere(shape="sphere", **segments).mesh()}
    sources |= {Path(mesh).stem: read_mesh(Path(mesh)) for mesh in meshes}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = {"size": SIZE, "fov": FOV, "eye": list(EYE), "lamp": list(LAMP), "n": list(COPPER_N)}
        (folder / "theirs.py").write_text(MITSUBA % {**settings, "k": list(COPPER_K)})
        for source, mesh in sources.items():
            print(f"# {source}: {write_mesh(mesh, folder / 'mesh.ply')} triangles")
            for surface, numbers in SURFACES.items():
                cells = compare(folder, python, *numbers)
                print(f"{source + ', ' + surface:32s} " + "   ".join(cells), flush=True)


if __name__ == "__main__":
    main([word for word in sys.argv[1:] if not word.startswith("-")])
