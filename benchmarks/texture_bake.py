"""How much processor time does a texture of ambient occlusion take, ours and Blender's, at equal error?

Question   Processor seconds of SIDE x SIDE texels to a root mean square error of TARGET, and those that
           Cycles (Blender's AO pass, on the CPU, without denoising) takes to the error that ours then has.
Mesh       As it is if it has uv; otherwise with uv that xatlas makes beforehand, for both the same.
Error      Ours: 4,096 rays at TEXELS random texels, beside the stated error and the z-scores. Blender's: at
           FEWER x FEWER texels, against FINEST of its own samples, because the error of a number of samples
           does not depend on the size; its reference errs, too, which favours it by less than 10 %.
Time       Of the bake alone, all threads, without reading and writing. Blender's grows linearly with the
           samples, so the line through two runs leads to the number that it needs.
           Needs `pip install bpy` in an environment of its own, whose Python is given.

    python benchmarks/texture_bake.py MESH PYTHON_WITH_BPY
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from _bench import SMALL, header, took
from illumcli.atlas.centres import covered_centres
from illumcli.atlas.triangles import TextureSize
from illumcli.atlas.unwrap import unwrapped
from illumcli.baking.at_texels import sampled_at_texels
from illumcli.baking.bake import bake_context
from illumcli.baking.context import BakeContext, TexelChannels
from illumcli.baking.inputs import BakeWork, prepare_bake
from illumcli.baking.sampling import BakeSampler, RayCounts
from illumcli.baking.settings import BakeJob, BakeSettings
from illumcli.baking.texel_points import texel_points
from illumcli.files.journal import Journal
from illumcli.geometry.triangulate import triangulate
from illumcli.mesh_files import read_mesh
from illumcli.progress import no_progress

SIDE, FEWER = (64, 32) if SMALL else (2048, 256)
TARGET = 0.05 if SMALL else 0.01
COUNTS, FINEST = ((4, 16), 64) if SMALL else ((16, 64, 128), 1024)
TIMED = (1, 2) if SMALL else (4, 16)
TEXELS, RAYS = (50, 256) if SMALL else (2000, 4096)
THREADS = len(os.sched_getaffinity(0))

BLENDER = """
import os, sys
import bpy
import numpy as np
mesh, out = sys.argv[1:3]
side, samples, threads, seed = map(int, sys.argv[3:])
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.obj_import(filepath=mesh, forward_axis="NEGATIVE_Z", up_axis="Y")
thing = bpy.context.selected_objects[0]
bpy.context.view_layer.objects.active = thing
thing.data.polygons.foreach_set("use_smooth", [True] * len(thing.data.polygons))
scene = bpy.context.scene
scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
scene.cycles.samples, scene.cycles.seed = samples, seed
scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
scene.render.threads_mode, scene.render.threads = "FIXED", threads
scene.world = bpy.data.worlds.new("world")
scene.world.light_settings.distance = 1e9
image = bpy.data.images.new("ao", side, side, float_buffer=True, is_data=True)
material = bpy.data.materials.new("material")
material.use_nodes = True
node = material.node_tree.nodes.new("ShaderNodeTexImage")
node.image = image
material.node_tree.nodes.active = node
thing.data.materials.clear()
thing.data.materials.append(material)
before = os.times()
bpy.ops.object.bake(type="AO", margin=0, use_clear=True)
after = os.times()
pixels = np.empty(side * side * 4, np.float32)
image.pixels.foreach_get(pixels)
np.save(out, pixels.reshape(side, side, 4)[::-1, :, 0])
print("seconds", after.user + after.system - before.user - before.system, after.elapsed - before.elapsed)
"""


def with_uv(path: Path, folder: Path) -> Path:
    """An OBJ of the mesh's triangles, with its uv or new ones."""
    mesh = read_mesh(path)
    if mesh.uvs is not None and path.suffix == ".obj":
        return path
    triangles = mesh.corners[triangulate(mesh).corners]
    atlas = unwrapped(mesh.vertices, triangles, TextureSize(SIDE, SIDE), no_progress)
    lines = ["v {:.9g} {:.9g} {:.9g}\n".format(*each) for each in mesh.vertices]
    lines += ["vt {:.9g} {:.9g}\n".format(*each) for each in atlas.uvs]
    for corners, uvs in zip(triangles + 1, atlas.corner_uvs + 1, strict=True):
        lines.append("f " + " ".join(f"{a}/{b}" for a, b in zip(corners, uvs, strict=True)) + "\n")
    out = folder / "mesh.obj"
    out.write_text("".join(lines))
    return out


def blender(python: str, mesh: Path, side: int, samples: int, seed: int) -> tuple[np.ndarray, float, float]:
    """Texels of Blender's bake, and its processor and wall seconds."""
    with tempfile.TemporaryDirectory() as folder:
        script, out = Path(folder, "bake.py"), Path(folder, "ao.npy")
        script.write_text(BLENDER)
        words = [str(mesh), str(out), str(side), str(samples), str(THREADS), str(seed)]
        done = subprocess.run([python, str(script), *words], capture_output=True, text=True, check=True)
        line = next(line for line in done.stdout.splitlines() if line.startswith("seconds"))
        cpu, wall = map(float, line.split()[1:])
        return np.load(out), cpu, wall


def prepared(mesh: Path, side: int, folder: Path) -> tuple[BakeWork, BakeContext]:
    """Our bake, ready to start."""
    settings = BakeSettings(texture=(side, side), target_error=TARGET, reconstruct=True)
    work = prepare_bake(BakeJob(mesh, (folder / "ao.png",), settings))
    journal = Journal(folder / "journal", "0" * 32)
    return work, bake_context(work, no_progress, journal)


def checked(context: BakeContext, values: TexelChannels) -> tuple[float, float]:
    """Root mean square error at random texels against many rays, and of the z-scores."""
    points = values.texels.points
    count = len(points.key)
    index = np.sort(np.random.default_rng(0).choice(count, min(TEXELS, count), replace=False))
    sampler = BakeSampler(points, context.occluders, context.measures[0], 77, THREADS, no_progress)
    truth = sampler.estimate("truth", RayCounts(index, np.full(len(index), RAYS)), 5).values.w
    channels = values.of_points.channels
    off = channels["obscurance"][index].astype(float) - truth
    stated = channels["standard_error"][index].astype(float)
    return float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.mean((off / np.maximum(stated, 1e-6)) ** 2)))


def main() -> None:
    path, *others = [word for word in sys.argv[1:] if not word.startswith("-")]
    header(__doc__.splitlines()[0], mesh=Path(path).name, side=SIDE, target=TARGET, threads=THREADS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        mesh = with_uv(Path(path), folder)

        # ours
        work, context = prepared(mesh, SIDE, folder)
        with closing(context.journal):
            values: list[TexelChannels] = []
            ours = took(lambda: values.append(sampled_at_texels(context, work.slots)))
        texels = sum(each.overlaps.read for each in values[0].texels.textures)
        stated = values[0].of_points.statistics["obscurance"].rmse
        error, z = checked(context, values[0])
        print(
            f"ours      {texels} texels: {ours.cpu:.1f} s of processor, {ours.wall:.1f} s; "
            f"error {error:.4f}, stated {stated:.4f}, z {z:.2f}"
        )
        if not others:
            return

        # Blender's errors at few texels, and its seconds at all
        few_work, few_context = prepared(mesh, FEWER, folder)
        few = texel_points(few_context.surfaces, few_work.slots, TextureSize(FEWER, FEWER), {}, THREADS)
        few_context.journal.close()
        centres = np.zeros(FEWER * FEWER, bool)
        centres[covered_centres(few.textures[0].triangles).texel] = True
        finest = blender(others[0], mesh, FEWER, FINEST, 7)[0].ravel()[centres]
        errors = []
        for count in COUNTS:
            off = blender(others[0], mesh, FEWER, count, 1)[0].ravel()[centres] - finest
            errors.append(float(np.sqrt(np.mean(off.astype(float) ** 2))))
            print(f"blender   {count:4} samples: error {errors[-1]:.4f}")
        slope, start = np.polyfit(np.log(COUNTS), np.log(errors), 1)
        needed = float(np.exp((np.log(error) - start) / slope))
        seconds = []
        for count in TIMED:
            _, cpu, wall = blender(others[0], mesh, SIDE, count, 1)
            seconds.append(cpu)
            print(f"blender   {count:4} samples of {SIDE} x {SIDE}: {cpu:.1f} s of processor, {wall:.1f} s")
        each = (seconds[1] - seconds[0]) / (TIMED[1] - TIMED[0])
        total = seconds[0] + each * (needed - TIMED[0])
        print(f"blender   {needed:.0f} samples for error {error:.4f}: {total:.0f} s of processor")
        print(f"ratio blender / ours {total / ours.cpu:.1f}")


if __name__ == "__main__":
    main()
