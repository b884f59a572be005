"""How far is a picture of a glTF file from that of three.js, and what makes the difference?

Question   The relative difference of linear pixels under one point light, without shadows, environment and
           tone mapping: first as three.js draws, then with what it does otherwise taken out of its shader,
           one after the other.
Reference  three.js' WebGLRenderer and MeshStandardMaterial in a headless Chromium, into a texture of floats;
           textures without smaller copies of the image, as ours. The light's intensity [cd] is ours [W/sr]:
           both divide a white Lambertian surface's answer by pi.
Mask       Pixels that both cover and that are no part of an outline, brighter than 1/1000 of their mean.
           The difference is the largest of a pixel's channels, over the largest channel of three.js' pixel.

Needs `npm install three`, selenium, `apt-get install chromium chromium-driver`. Without a FILE it draws a
torus with textures of colour, metal and roughness made here.

    PYTHONPATH=src python benchmarks/gltf_peers.py NODE_MODULES [FILE.glb ...] [--side N] [--pictures DIR]
"""

from __future__ import annotations

import argparse
import base64
import json
import shutil
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import illumcli
from _bench import SMALL, header
from illumcli.files.seal import BLANK
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf.glb_writer import INDICES, VERTICES, GlbWriter

SIDE = 64 if SMALL else 512
FOV = 35
AWAY = np.array([0.6, 0.45, 1.0])
LAMP = np.array([1.2, 1.5, 1.4])
STEPS = (
    ("as it draws", ""),
    ("no light scattered twice by facets", "scatter"),
    ("(1 - c)^5 in place of its fit", "schlick"),
    ("no roughness of curvature, none at least", "curvature"),
)
"""What is taken out of three.js' shader beside what was before."""
PAGE = """\
<!doctype html><canvas id="c"></canvas>
<script type="importmap">{"imports": {"three": "./three/build/three.module.js"}}</script>
<script type="module">
import * as THREE from "three";
import {GLTFLoader} from "./three/examples/jsm/loaders/GLTFLoader.js";

const EDITS = {
  scatter: {lights_physical_pars_fragment: [[" * material.multiScatteringCompensation", ""]]},
  schlick: {
    common: [["exp2( ( - 5.55473 * dotVH - 6.98316 ) * dotVH )", "pow( max( 1.0 - dotVH, 0.0 ), 5.0 )"]],
  },
  curvature: {
    lights_physical_fragment: [["material.roughness += geometryRoughness;", ""],
                               ["max( roughnessFactor, 0.045 )", "max( roughnessFactor, 0.01 )"]],
    lights_physical_pars_fragment: [["max( material.roughness, 0.045 )", "max( material.roughness, 0.01 )"]],
  },
};

function edited(source, steps) {
  const edits = {};
  for (const step of steps)
    for (const [chunk, pairs] of Object.entries(EDITS[step])) (edits[chunk] ??= []).push(...pairs);
  for (const [chunk, pairs] of Object.entries(edits)) {
    let text = THREE.ShaderChunk[chunk];
    for (const [was, now] of pairs) {
      if (!text.includes(was)) throw new Error(`${chunk} has no ${was}`);
      text = text.replaceAll(was, now);
    }
    source = source.replace(`#include <${chunk}>`, text);
  }
  return source;
}

window.draw = async (file, view, steps) => {
  const renderer = new THREE.WebGLRenderer({canvas: document.getElementById("c")});
  const scene = new THREE.Scene();
  const model = (await new GLTFLoader().loadAsync(file)).scene;
  model.traverse(part => {
    if (!part.isMesh) return;
    const material = part.material;
    for (const name of ["map", "metalnessMap", "roughnessMap", "emissiveMap"]) if (material[name]) {
      material[name].generateMipmaps = false;
      material[name].minFilter = THREE.LinearFilter;
    }
    material.normalMap = material.aoMap = null;
    material.side = THREE.DoubleSide;
    material.transparent = false;
    material.onBeforeCompile = shader => { shader.fragmentShader = edited(shader.fragmentShader, steps); };
    material.customProgramCacheKey = () => steps.join();
  });
  scene.add(model);
  const lamp = new THREE.PointLight(0xffffff, view.intensity, 0, 2);
  lamp.position.set(...view.lamp);
  scene.add(lamp);
  const camera = new THREE.PerspectiveCamera(view.fov, 1, view.far / 1000, view.far);
  camera.position.set(...view.position);
  camera.lookAt(...view.target);
  const target = new THREE.WebGLRenderTarget(view.side, view.side, {type: THREE.FloatType});
  renderer.setRenderTarget(target);
  renderer.setClearColor(0x000000, 0);
  renderer.toneMapping = THREE.NoToneMapping;
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * view.side * view.side);
  renderer.readRenderTargetPixels(target, 0, 0, view.side, view.side, pixels);
  renderer.dispose();
  const bytes = new Uint8Array(pixels.buffer);
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return {pixels: btoa(text), version: THREE.REVISION};
};
window.ready = true;
</script>
"""


# --- a file ---------------------------------------------------------------------------------------------


def write_torus(path: Path, is_textured: bool) -> None:
    """A torus of one material, or with base colour, metal and roughness as smooth waves in two textures."""
    y, x = np.meshgrid(*2 * (np.arange(128) / 128 * 2 * np.pi,), indexing="ij")
    color = np.stack([0.5 + 0.4 * np.sin(each) for each in (3 * x, 2 * x + 2 * y, 4 * y)], axis=2)
    metal = np.clip(0.5 + 2 * np.sin(2 * x) * np.sin(2 * y), 0, 1)
    packed = np.stack([0 * x, 0.5 + 0.35 * np.sin(x - 3 * y), metal], axis=2)
    asset = {"version": "2.0", "extras": {"illum": {"body": BLANK}}}
    writer = GlbWriter({"asset": asset, "scene": 0, "scenes": [{"nodes": [0]}]})
    images = [writer.image(_png(path, each), "image/png", "waves") for each in (color, packed)]

    # A grid around the axis and around the tube, whose first row and column are repeated as the last.
    v, u = np.meshgrid(np.linspace(0, 1, 65), np.linspace(0, 1, 129), indexing="ij")
    around, tube = 2 * np.pi * u, 2 * np.pi * v
    level = np.stack([np.cos(around), 0 * u, -np.sin(around)], axis=2)
    normal = np.cos(tube)[..., None] * level + np.sin(tube)[..., None] * [0, 1, 0]
    rows = [0.7 * level + 0.3 * normal, normal, np.stack([4 * u, 2 * v], axis=2)]
    corner = np.arange(65 * 129).reshape(65, 129)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=2).reshape(-1).astype(np.uint32)
    position, *others = (each.reshape(-1, each.shape[2]).astype(np.float32) for each in rows)
    bounds = {"min": position.min(axis=0).tolist(), "max": position.max(axis=0).tolist()}
    attributes = {
        "POSITION": writer.table(position, VERTICES, **bounds),
        "NORMAL": writer.table(others[0], VERTICES),
        "TEXCOORD_0": writer.table(others[1], VERTICES),
    }
    part = {"attributes": attributes, "indices": writer.table(triangles, INDICES), "material": 0}
    plain = {"baseColorFactor": [0.8, 0.4, 0.2, 1], "metallicFactor": 0.5, "roughnessFactor": 0.4}
    textured = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    said = textured if is_textured else plain
    writer.json |= {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [part]}],
        "materials": [{"name": "waves", "pbrMetallicRoughness": said}],
        "textures": [{"source": image} for image in images],
    }
    writer.write(path)


def _png(beside: Path, pixels: NDArray[np.float64]) -> bytes:
    """The bytes of a PNG of 8 bits."""
    import OpenImageIO as oiio

    path = beside.with_name("waves.png")
    oiio.ImageBuf(np.round(pixels * 255).astype(np.uint8)).write(str(path))
    return path.read_bytes()


def view_of(file: Path, side: int) -> dict[str, Any]:
    """A camera that sees the whole mesh, and a lamp beside it."""
    points = read_mesh(file).vertices
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    distance = radius / np.sin(np.radians(FOV / 2)) * 1.02
    return {
        "position": (middle + distance * AWAY / np.linalg.norm(AWAY)).tolist(),
        "target": middle.tolist(),
        "fov": FOV,
        "side": side,
        "far": 4 * distance,
        "lamp": (middle + 2 * radius * LAMP).tolist(),
        "intensity": 20 * radius**2,
    }


# --- two pictures ---------------------------------------------------------------------------------------


def ours(file: Path, view: dict[str, Any]) -> NDArray[np.float32]:
    """(H, W, 4) red, green, blue, alpha."""
    film = {"width": view["side"], "height": view["side"], "samples": 1}
    lamp = {"light": "point", "position": view["lamp"], "intensity": view["intensity"], "shadows": False}
    scene = {
        "version": 1,
        "camera": {name: view[name] for name in ("position", "target", "fov")},
        "film": film,
        "meshes": {"file": {"file": file.name, "materials": True}},
        "objects": [{"mesh": "file"}],
        "lights": [lamp],
    }
    path = file.with_suffix(".yaml")
    path.write_text(json.dumps(scene))
    return illumcli.render(path)["beauty"]


class ThreeJs:
    """A browser with three.js, and the files of a folder."""

    def __init__(self, folder: Path, browser: Any, address: str) -> None:
        self._folder, self._browser = folder, browser
        (folder / "page.html").write_text(PAGE)
        browser.get(f"{address}/page.html")
        browser.set_script_timeout(300)
        self.version = ""

    def picture(self, file: Path, view: dict[str, Any], steps: Sequence[str]) -> NDArray[np.float32]:
        """(H, W, 4) red, green, blue, alpha, with these things taken out of its shader."""
        script = (
            "const [file, view, steps, done] = arguments;"
            "const draws = () => draw(file, view, steps).then(done, e => done({error: String(e)}));"
            "const waits = () => window.ready ? draws() : setTimeout(waits, 50); waits();"
        )
        answer = self._browser.execute_async_script(script, f"./{file.name}", view, list(steps))
        if "error" in answer:
            raise RuntimeError(answer["error"])
        self.version = answer["version"]
        pixels = np.frombuffer(base64.b64decode(answer["pixels"]), np.float32)
        return pixels.reshape(view["side"], view["side"], 4)[::-1]


@contextmanager
def three_js(folder: Path, modules: Path) -> Iterator[ThreeJs]:
    """A headless Chromium that draws files of `folder`."""
    from selenium import webdriver

    (folder / "three").symlink_to(modules.resolve() / "three")
    handler = partial(Quiet, directory=str(folder))
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for switch in ("--headless", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader"):
        options.add_argument(switch)
    options.add_argument(f"--user-data-dir={folder / 'profile'}")
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
        try:
            yield ThreeJs(folder, browser, f"http://127.0.0.1:{server.server_port}")
        finally:
            browser.quit()
            server.shutdown()


class Quiet(SimpleHTTPRequestHandler):
    """A server that prints nothing."""

    def log_message(self, *words: object) -> None:
        pass


# --- their difference -----------------------------------------------------------------------------------


def inner(alpha: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels that are covered and whose eight neighbours are."""
    covered = np.pad(alpha > 0, 1)
    sides = range(3)
    height, width = alpha.shape
    return np.all([covered[i : i + height, j : j + width] for i in sides for j in sides], axis=0)


def differences(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """(K,) relative difference of the pixels of the mask, largest channel over largest channel of b."""
    level = b[..., :3].max(axis=2)
    mask = inner(a[..., 3]) & inner(b[..., 3]) & (level > np.mean(level[b[..., 3] > 0]) / 1000)
    return np.abs(a[..., :3] - b[..., :3]).max(axis=2)[mask].astype(float) / level[mask]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("modules", type=Path)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--side", type=int, default=SIDE)
    parser.add_argument("--small", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        write_torus(folder / "plain.glb", is_textured=False)
        write_torus(folder / "textured.glb", is_textured=True)
        for file in options.files:
            shutil.copy(file, folder / file.name)
        with three_js(folder, options.modules) as peer:
            header("How far is a picture of a glTF file from that of three.js?", side=options.side, repeats=1)
            cells = "".join(f"{cell:>10s}" for cell in ("pixels", "median", "99 %", "largest"))
            print(f"{'file':12s} {'three.js':44s}{cells}")
            for name in ("plain.glb", "textured.glb", *(each.name for each in options.files)):
                compare(peer, folder / name, options.side, options.pictures)
            print(f"# three.js {peer.version}")


def compare(peer: ThreeJs, file: Path, side: int, pictures: Path | None) -> None:
    """The rows of a file."""
    view = view_of(file, side)
    own = ours(file, view)
    if pictures:
        np.save(pictures / f"{file.stem}-ours.npy", own)
    steps: list[str] = []
    for text, step in STEPS:
        steps += [step] if step else []
        other = peer.picture(file, view, steps)
        found = differences(own, other)
        median, high = np.quantile(found, [0.5, 0.99])
        print(f"{file.stem:12s} {text:44s}{len(found):10d}{median:10.2g}{high:10.2g}{found.max():10.2g}")
        if pictures:
            np.save(pictures / f"{file.stem}-three-{len(steps)}.npy", other)


if __name__ == "__main__":
    main()
