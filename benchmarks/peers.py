"""How long do other renderers take for the same picture, at equal error, as whole processes?

Ambient occlusion: the bunny of unit radius on a floor under a constant sky, white; Mitsuba 3 with its direct
integrator (the surface alone sampled, multijittered, box filter), vectorised (llvm), the same denoised by
Intel's Open Image Denoise (albedo and normal of a second pass of 4 samples, told to be clean, which errs less
than without), and scalar. Phong with shadows: the same under two point lights, POV-Ray. Equal error decides:
each renderer's error is measured
against a reference of its own with other seeds, and the time at the error asked for is interpolated on
log-log; the references' difference says whether the pictures are equal. Everything counts, from the start of
the process to the written file; meshes are the same PLY, nothing is kept between runs but in the row `warm`.

    PEERS=/path/to/venv/bin/python PYTHONPATH=src python benchmarks/peers.py [--small] [mitsuba povray]

PEERS has `pip install numpy mitsuba mitsuba-oidn`, which wants an LLVM of 16 or later (DRJIT_LIBLLVM_PATH
says where); POV-Ray is Debian's package `povray`.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from _bench import (
    MESHES,
    REPEATS,
    SMALL,
    Took,
    bunny,
    header,
    illum,
    interleaved,
    process,
    ratio,
    spread,
    table,
)
from illumcli.images.reader import read_image

ERROR = 0.01
RECONSTRUCTED = "illum reconstructed"
RECONSTRUCT = ("-D", "obscurance.reconstruct=true")
SIZE = (64, 36) if SMALL else (1280, 720)
LARGE = (64, 36) if SMALL else (1920, 1080)
EYE, TARGET, FOV = (2.2, 1.6, 3.4), (0.0, 0.55, 0.0), 30.0
LAMPS = ((3.0, 4.0, 2.0), (-3.0, 3.0, 3.0))


def placed_bunny(folder: Path) -> Path:
    """The bunny as illum's `fit: 1` places it, as a PLY with smooth normals that everybody reads."""
    from illumcli.geometry import scene_geometry, transforms
    from illumcli.geometry.corner_normals import corner_normals
    from illumcli.geometry.shapes.teapot import Teapot
    from illumcli.mesh_files import read_mesh
    from illumcli.scene.spec import Transform

    source = bunny(folder)
    mesh = read_mesh(folder / source) if source.endswith(".obj") else Teapot(shape="teapot").mesh()
    matrix = transforms.transform_matrix(Transform(fit=1.0), mesh)
    geometry = scene_geometry.place_meshes([mesh], [matrix])
    points = geometry.render_space.to_world(geometry.vertices.astype(np.float64))
    normals = scene_geometry.scene_normals(geometry, [corner_normals(mesh)])
    own = np.zeros((len(points), 3), np.float32)
    own[geometry.triangles] = normals.values[normals.index[geometry.corners]]
    path = folder / "placed.ply"
    vertices = np.concatenate([points, own], axis=1).astype("<f4")
    faces = np.empty(len(geometry.triangles), [("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, geometry.triangles
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    path.write_bytes(
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{names}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n".encode()
        + vertices.tobytes() + faces.tobytes()
    )  # fmt: skip
    np.savez(folder / "placed.npz", points=points, normals=own, triangles=geometry.triangles)
    return path


# --- ambient occlusion: illum and Mitsuba ---------------------------------------------------------------


def illum_ambient(folder: Path) -> Path:
    path = folder / "ambient.yaml"
    path.write_text(f"""\
version: 1
camera: {{position: {list(EYE)}, target: {list(TARGET)}, fov: {FOV}}}
film: {{width: {SIZE[0]}, height: {SIZE[1]}, samples: 4, background: 0}}
ambient: 1
obscurance: {{samples: 16}}
materials: {{white: {{model: lambert, diffuse: 1}}}}
objects:
  - {{mesh: placed.ply, material: white}}
  - {{mesh: {{shape: disc, radius: 20}}, material: white}}
outputs: {{files: ["ambient.exr"], colour: float}}
""")
    return path


MITSUBA = """
import sys
variant, spp, seed, width, height, out = sys.argv[1], *map(int, sys.argv[2:6]), sys.argv[6]
denoised = sys.argv[7:] == ["denoised"]
import mitsuba as mi
mi.set_variant(variant)
from mitsuba import ScalarTransform4f as T
white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1, "hide_emitters": True},
    "sensor": {
        "type": "perspective", "fov": %(fov)r, "fov_axis": "y",
        "to_world": T().look_at(origin=%(eye)r, target=%(target)r, up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                 "component_format": "float32", "rfilter": {"type": "box"}},
        "sampler": {"type": "multijitter", "sample_count": spp},
    },
    "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
    "bunny": {"type": "ply", "filename": "placed.ply", "bsdf": {"type": "twosided", "nested": white}},
    "floor": {"type": "disk", "to_world": T().rotate([1, 0, 0], -90).scale(20),
              "bsdf": {"type": "twosided", "nested": white}},
})
image = mi.render(scene, spp=spp, seed=seed)
if denoised:
    import numpy as np
    from mitsuba_oidn import denoise
    guides = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
    guides = np.array(mi.render(scene, integrator=guides, spp=4, seed=seed + 1_000_000))
    albedo, normal = (np.ascontiguousarray(guides[..., k : k + 3]) for k in (0, 3))
    image = mi.TensorXf(denoise(np.array(image), albedo, normal, hdr=True, clean_aux=True))
mi.util.write_bitmap(out, image, write_async=False)
"""


def mitsuba(folder: Path, python: str, variant: str, spp: int, seed: int, out: str = "m.exr") -> None:
    variant, *denoised = variant.split(" + ")
    words = [python, "mitsuba_ambient.py", variant, *map(str, (spp, seed, *SIZE)), out]
    words += ["denoised"] * len(denoised)
    process(words, folder, PYTHONPATH="")


def ambient(folder: Path, python: str) -> None:
    """Time at equal error of ambient occlusion."""
    scene = illum_ambient(folder)
    script = MITSUBA % {"fov": FOV, "eye": list(EYE), "target": list(TARGET)}
    (folder / "mitsuba_ambient.py").write_text(script)

    def own(samples: int, rays: int, seed: int, out: str, *words: str) -> None:
        finer = ("-D", f"film.samples={samples}", "-D", f"obscurance.samples={rays}")
        illum("render", scene, *finer, "--seed", seed, "-o", out, "--force", "-q", *words, cwd=folder)

    fine = 4 if SMALL else 32
    own(fine, 16, 1001, "truth-illum.exr", "-D", "film.adaptive=false")
    mitsuba(folder, python, "llvm_ad_rgb", fine * 16, 1001, "truth-mitsuba.exr")
    truths = {"illum": picture(folder / "truth-illum.exr"), "mitsuba": picture(folder / "truth-mitsuba.exr")}
    print(f"# difference of the references: RMSE {rmse(*truths.values()):.4f}")

    counts = [(2, 4), (4, 8)] if SMALL else [(4, 8), (8, 8), (16, 8)]
    few = [(1, 2), (2, 2)] if SMALL else [(2, 1), (3, 1), (4, 1), (8, 1)]  # adaptive by default
    spps = {
        "llvm_ad_rgb": [4, 16] if SMALL else [16, 64, 256],
        "llvm_ad_rgb + OIDN": [2, 4] if SMALL else [2, 4, 16],
        "scalar_rgb": [4, 16] if SMALL else [16, 64],
    }
    makers: dict[str, tuple[str, list[tuple[str, Callable[[int], None]]]]] = {
        "illum": (
            "illum",
            [(f"{p} x {m}", lambda s, p=p, m=m: own(p, m, s, "i.exr", "--no-cache")) for p, m in counts],
        ),
        RECONSTRUCTED: (
            "illum",
            [
                (f"{p} x {m}", lambda s, p=p, m=m: own(p, m, s, "i.exr", "--no-cache", *RECONSTRUCT))
                for p, m in few
            ],
        ),
    }
    for variant, counts_of_variant in spps.items():
        runs = [
            (f"{n} spp", lambda s, v=variant, n=n: mitsuba(folder, python, v, n, s))
            for n in counts_of_variant
        ]
        makers[f"mitsuba {variant}"] = ("mitsuba", runs)
    files = {"illum": "i.exr", "mitsuba": "m.exr"}
    taken: dict[str, list[list[tuple[float, float, float]]]] = {name: [] for name in makers}
    for repeat in range(REPEATS):
        for name, (kind, runs) in makers.items():
            curve = []
            for _, run in runs:
                (time,) = interleaved({"": lambda run=run, repeat=repeat: run(repeat + 1)}, 1)[""]
                error = rmse(picture(folder / files[kind]), truths[kind])
                curve.append((error, time.wall, time.cpu))
            taken[name].append(curve)
    print(f"{'':26s} {'':10s} {'RMSE':>10s} {'wall [s]':>26s} {'cpu [s]':>26s}")
    for name, (_, runs) in makers.items():
        for k, (label, _) in enumerate(runs):
            errors, walls, cpus = zip(*(curve[k] for curve in taken[name]), strict=True)
            print(f"{name:26s} {label:>10s} {np.mean(errors):10.4f} {spread(walls):>26s} {spread(cpus):>26s}")
    at = {
        name: [Took(at_error(curve, 1), at_error(curve, 2)) for curve in curves]
        for name, curves in taken.items()
    }
    print(f"# at RMSE {ERROR}, interpolated or extended on log-log")
    table(at, "illum")
    for own_name in ("illum", RECONSTRUCTED):
        for name in list(at)[2:]:
            ratio(f"{name} / {own_name}", at, name, own_name)


def at_error(curve: Sequence[tuple[float, ...]], which: int) -> float:
    """Seconds at the error asked for: a start that all runs share, and a power of the error."""
    points = sorted(curve, reverse=True)
    (e0, *_), (e1, *_) = near = sorted(points, key=lambda p: abs(math.log(p[0] / ERROR)))[:2]
    if e0 == e1:
        return near[0][which]
    slope = math.log(near[0][which] / near[1][which]) / math.log(e0 / e1)
    return near[0][which] * (ERROR / e0) ** slope


def picture(path: Path) -> np.ndarray:
    """(H, W) the red channel: all is white."""
    return read_image(path).channels["R"].astype(np.float64)


def rmse(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.square(a - b).mean()))


# --- Phong and shadows: illum and POV-Ray ----------------------------------------------------------------


def lit(folder: Path) -> None:
    """Time of the same Phong picture with shadows, one sample per pixel."""
    (folder / "lit.yaml").write_text(f"""\
version: 1
camera: {{position: {list(EYE)}, target: {list(TARGET)}, fov: {FOV}}}
film: {{width: {LARGE[0]}, height: {LARGE[1]}, samples: 1, background: 0}}
materials: {{gloss: {{model: phong, diffuse: 0.6, specular: 0.3, exponent: 40}}}}
objects:
  - {{mesh: placed.ply, material: gloss}}
  - {{mesh: {{shape: disc, radius: 20}}, material: gloss}}
lights:
  - {{light: point, position: {list(LAMPS[0])}, intensity: 0.6, attenuation: {{law: none}}}}
  - {{light: point, position: {list(LAMPS[1])}, intensity: 0.6, attenuation: {{law: none}}}}
outputs: {{files: ["lit.png"]}}
""")
    (folder / "lit.pov").write_text(pov_scene(np.load(folder / "placed.npz")))

    def povray() -> None:
        words = ["povray", "+Ilit.pov", "+Opov.png", f"+W{LARGE[0]}", f"+H{LARGE[1]}", "-A", "-D", "-GA"]
        process(words, folder)

    def own(*words: str) -> None:
        illum("render", "lit.yaml", "--force", "-q", *words, cwd=folder)

    runs = {
        "illum": lambda: own("--no-cache"),
        "illum, warm": lambda: own("-D", "materials.gloss.exponent=41"),
        "POV-Ray": povray,
    }
    for run in runs.values():
        run()
    own("--no-cache")
    own_picture, other = picture(folder / "lit.png"), picture(folder / "pov.png")
    print(f"# difference of the pictures: RMSE {rmse(own_picture, other):.4f} of display values 0 to 1")
    times = interleaved(runs)
    table(times, "illum")
    ratio("POV-Ray / illum", times, "POV-Ray", "illum")


def pov_scene(mesh: dict[str, np.ndarray]) -> str:
    """The scene in POV-Ray's words, its left-handed space mirrored by the camera."""

    def vectors(name: str, values: np.ndarray) -> str:
        rows = ",".join(f"<{a:.7g},{b:.7g},{c:.7g}>" for a, b, c in values.tolist())
        return f"{name} {{ {len(values)}, {rows} }}"

    back = np.subtract(EYE, TARGET)
    height = 2 * math.tan(math.radians(FOV) / 2)
    width = height * LARGE[0] / LARGE[1]
    forward = -back / np.linalg.norm(back)
    right = np.cross(forward, (0, 1, 0))
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)

    def v(values: Sequence[float]) -> str:
        return "<" + ",".join(f"{x:.9g}" for x in values) + ">"

    lamps = "\n".join(f"light_source {{ {v(p)} color rgb 0.6 }}" for p in LAMPS)
    finish = "finish { ambient 0 diffuse 0.6 phong 0.3 phong_size 40 }"
    return f"""#version 3.7;
global_settings {{ assumed_gamma 1 }}
background {{ rgb 0 }}
camera {{ location {v(EYE)} right {v(right * width)} up {v(up * height)} direction {v(forward)} }}
{lamps}
mesh2 {{
{vectors("vertex_vectors", mesh["points"])}
{vectors("normal_vectors", mesh["normals"])}
{vectors("face_indices", mesh["triangles"])}
pigment {{ rgb 1 }} {finish} }}
disc {{ <0,0,0>, <0,1,0>, 20 pigment {{ rgb 1 }} {finish} }}
"""


def main(wanted: Sequence[str]) -> None:
    python = os.environ.get("PEERS", "")
    header(
        "How long do other renderers take for the same picture, at equal error?",
        film=f"{SIZE[0]}x{SIZE[1]}", error=ERROR, mesh="bunny" if MESHES.exists() and not SMALL else "teapot",
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        placed_bunny(folder)
        if "mitsuba" in wanted:
            version = process(
                [python, "-c", "import mitsuba as m; print(m.__version__)"], folder, PYTHONPATH=""
            )
            print(f"# mitsuba {version.stdout.strip()}")
            ambient(folder, python)
        if "povray" in wanted:
            if shutil.which("povray") is None:
                sys.exit("povray is not installed; apt-get install povray")
            lit(folder)


if __name__ == "__main__":
    main([word for word in sys.argv[1:] if word in ("mitsuba", "povray")] or ("mitsuba", "povray"))
