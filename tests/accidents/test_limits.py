"""Inputs that are too large are refused before anything is allocated; paths lead to regular files inside."""

from __future__ import annotations

import json
import lzma
import os
import re
import struct
import zlib
from types import SimpleNamespace

import pytest

from illumcli import memory
from illumcli.errors import InputError, LimitError
from illumcli.render_graph import limits

TOO_LARGE = {
    "film": "film: {width: 1000000, height: 1000000}",
    "rays": "film: {width: 60000, height: 60000, samples: 1000}",
    "obscurance rays": "film: {width: 10000, height: 10000}\nobscurance: {samples: 60000}\nambient: 1\n"
    "objects: [{mesh: {shape: sphere}}]",
}


# by way of a small process: a child begins with the memory of its parent
MEASURED = """
import json, os, resource, subprocess, sys
found = []
for words in json.loads(sys.argv[1]):
    process = subprocess.Popen(
        [sys.executable, "-m", "illumcli", *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (5 << 30,) * 2),
    )
    told = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    found.append((os.waitstatus_to_exitcode(status), used.ru_maxrss, told))
print(json.dumps(found))
"""


def measured(python, folder, commands):
    """Exit code, peak memory [KiB] and stderr of each command, which has 5 GiB of addresses."""
    return json.loads(python(MEASURED, json.dumps(commands), cwd=folder))


@pytest.mark.parametrize("what", TOO_LARGE)
def test_too_large_is_exit_4_in_one_line_with_little_memory(python, tmp_path, what):
    (tmp_path / "s.yaml").write_text(f"version: 1\n{TOO_LARGE[what]}\n")
    ((code, kilobytes, told),) = measured(python, tmp_path, [["render", "s.yaml"]])
    assert code == 4, told
    assert len(told.splitlines()) == 1
    assert kilobytes < 200 * 1024
    assert os.listdir(tmp_path) == ["s.yaml"]


def test_little_memory_and_little_disk_are_refused_before_anything_is_made(folder, monkeypatch):
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene

    monkeypatch.setattr(memory, "free_memory", lambda: 100_000)
    with pytest.raises(LimitError, match="memory"):
        render_scene(
            RenderJob(folder / "scene.yaml", RenderOptions(pattern=str(folder / "x.exr"), cache=False))
        )
    monkeypatch.undo()
    disk = SimpleNamespace(f_bavail=1, f_frsize=100)
    monkeypatch.setattr(limits.os, "statvfs", lambda path: disk)
    with pytest.raises(LimitError, match="disk"):
        render_scene(
            RenderJob(folder / "scene.yaml", RenderOptions(pattern=str(folder / "x.exr"), cache=False))
        )
    assert not list(folder.glob("*.exr"))


def test_what_the_machine_does_not_say_is_no_limit(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: None)
    limits.refuse_memory(10**9, 10**9, 10**9, {"meshes": 10**18}, "here")
    assert memory.in_words(1500 * 2**40) == "1.5e+03 TiB"


@pytest.fixture(scope="module")
def bombs(tmp_path_factory):
    """Folder of small files that need more memory than machines have."""
    folder = tmp_path_factory.mktemp("bombs")

    # a PNG of 65,535 x 65,535 black pixels, one bit each: 64 times the same packed rows
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    side, row = 65535, bytes(1 + 65535 // 8 + 1)
    packer = zlib.compressobj(9, wbits=-15)
    many = packer.compress(row * 1024) + packer.flush(zlib.Z_FULL_FLUSH)
    last = packer.compress(row * 1023) + packer.flush()
    packed = b"\x78\x9c" + 63 * many + last + struct.pack(">I", len(row) * side % 65521 << 16 | 1)
    header = struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    (folder / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + parts)
    # meshes by the count of their triangles: so many spheres as the machine cannot hold
    count = 3 + (memory.free_memory() or 0) // (640 * 2 * 4096 * 2048)
    sphere = "{mesh: {shape: sphere, segments: 4096, rings: 2048}}"
    start = "version: 1\nambient: 1\nfilm: {width: 8, height: 8, samples: 1}\n"
    texture = "{model: lambert, diffuse: {texture: bomb.png}}"
    (folder / "spheres.yaml").write_text(f"{start}objects: [{', '.join([sphere] * count)}]\n")
    (folder / "texture.yaml").write_text(
        f"{start}objects: [{{mesh: {{shape: sphere}}, material: {texture}}}]\n"
    )
    phong = "{mesh: {shape: box}, material: {model: phong}}"
    (folder / "unused.yaml").write_text(f"{start}materials: {{m: {texture}}}\nobjects: [{phong}]\n")
    (folder / "wide.yaml").write_text(
        f"{start.replace('8', '65536')}objects: [{phong}]\nobscurance: {{samples: 1}}\n"
    )
    (folder / "bomb.mtl").write_text("newmtl a\nmap_Kd bomb.png\n")
    (folder / "mesh.obj").write_text(
        "mtllib bomb.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"
    )
    with lzma.open(folder / "bomb.json.xz", "wb") as file:
        for _ in range(257):
            file.write(b" " * (1 << 20))
    return folder


BOMBED = [
    ["render", "texture.yaml"], ["render", "spheres.yaml"], ["render", "mesh.obj"],
    ["check", "texture.yaml"], ["check", "spheres.yaml"], ["plan", "texture.yaml"],
    ["check", "mesh.obj"], ["plan", "mesh.obj"],
    ["plan", "spheres.yaml"], ["sweep", "spheres.yaml", "-D", "seed=1,2"],
    ["ao-bake", "spheres.yaml", "-o", "x.npz"], ["compare", "bomb.png", "bomb.png"],
    ["verify", "bomb.json.xz"], ["converge", "wide.yaml", "--width", "65536"],
    ["converge", "texture.yaml"],
]  # fmt: skip


def test_small_files_that_stand_for_much_memory_are_exit_4_before_it_is_taken(python, bombs):
    for words, (code, kilobytes, told) in zip(BOMBED, measured(python, bombs, BOMBED), strict=True):
        assert code == 4, (words, told)
        assert re.search("takes about|MiB of text", told), (words, told)
        assert kilobytes < 500 * 1024, words


def test_sheets_that_no_memory_holds_are_told_before_anything_is_rendered(tmp_path, monkeypatch):
    from illumcli.commands.options import RenderOptions
    from illumcli.commands.sweep import sweep_scene
    from illumcli.commands.sweep_files import SweepFiles
    from illumcli.scene.variants import variants_of

    start = "version: 1\nambient: 1\nobjects: [{mesh: {shape: box}}]\n"
    (tmp_path / "s.yaml").write_text(f"{start}film: {{width: 1, height: 60000, samples: 1}}\n")
    settings = RenderOptions(pattern=str(tmp_path / "{seed}.png"), cache=False)
    files = SweepFiles(sheet=tmp_path / "sheet.png")
    monkeypatch.setattr("illumcli.memory.free_memory", lambda: 2 << 20)
    with pytest.raises(LimitError, match="a sheet of 8 pictures, up to 1 x 60000 pixels: takes about"):
        sweep_scene(tmp_path / "s.yaml", variants_of(["seed=1:8:8"]), settings, files)
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize("said", ["9" * 5000, "\u00b2"])
def test_references_are_numbers_of_variants_or_files(tmp_path, said):
    from illumcli.commands.sweep_reference import references_of

    with pytest.raises(InputError):
        references_of(said, [])


def plan_of(path):
    """The plan of a scene as text."""
    from illumcli.commands.options import RenderOptions
    from illumcli.commands.plan import ScenePlan
    from illumcli.commands.plan_table import plan_table

    return plan_table(ScenePlan(path, options=RenderOptions(cache=False)).parts())


def test_plans_show_what_shapes_and_textures_take(bombs):
    assert "shapes " in plan_of(bombs / "spheres.yaml")
    assert "textures 4,095.9 MiB" in plan_of(bombs / "texture.yaml")
    assert "textures" not in plan_of(bombs / "unused.yaml")


def test_plans_show_what_images_of_mesh_files_take(bombs, tmp_path):
    for name in ("bomb.png", "bomb.mtl", "mesh.obj"):
        (tmp_path / name).hardlink_to(bombs / name)
    (tmp_path / "mesh.gltf").write_text('{"asset": {"version": "2.0"}, "images": [{"uri": "bomb.png"}]}')
    start = "version: 1\nambient: 1\n"
    for mesh in ("mesh.obj", "mesh.gltf"):
        for use, is_used in (
            ("materials: true}", True),
            ("}", False),
            ("materials: true}, material: a", False),
        ):
            (tmp_path / "s.yaml").write_text(
                f"{start}materials: {{a: {{model: lambert}}}}\nobjects: [{{mesh: {{file: {mesh}, {use}}}]\n"
            )
            assert ("textures 4,095.9 MiB" in plan_of(tmp_path / "s.yaml")) == is_used


@pytest.fixture
def jail(tmp_path):
    """A scene two folders down, and what lies around it."""
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "secret.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (inner / "link.obj").symlink_to(tmp_path / "secret.obj")
    (inner / "loop.obj").symlink_to(inner / "loop.obj")
    (inner / "out").symlink_to(tmp_path)
    os.mkfifo(inner / "pipe.obj")
    (inner / "m.obj").write_text("mtllib ../../secret.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n")
    return inner


TRAVERSALS = [
    "../../secret.obj", "../../../../../../etc/passwd", "/etc/passwd", "/proc/self/mem", "/proc/kcore",
    "/dev/zero", "/dev/stdin", "link.obj", "loop.obj", "out/secret.obj", "pipe.obj", "..", ".",
    "a\0b.obj", "~/x.obj", "file:///etc/passwd", "//etc/passwd", "./../.././secret.obj",
    "out/../secret.obj", "x" * 5000,
]  # fmt: skip
AUDITED = """
import os, sys
root, found = os.path.realpath(sys.argv[1]), []
near, around = os.path.dirname(root), os.path.dirname(os.path.dirname(root))
CALLS = ("subprocess.Popen", "os.exec", "os.posix_spawn", "os.system", "os.fork", "os.forkpty",
         "socket.connect", "socket.bind", "socket.getaddrinfo")

def hook(event, words):
    if event in CALLS or event == "import" and root in str(words[1] or ""):
        found.append((event, words))
    if event == "open" and isinstance(words[0], (str, bytes)):
        name = os.path.realpath(os.fsdecode(words[0]))
        if name in sys.path:
            return
        if name.startswith(around) and not name.startswith(near) or name in ("/etc/passwd", "/proc/kcore"):
            found.append(name)

from pathlib import Path
from illumcli.errors import IllumError
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.images import exr
import illumcli.commands.check
os.chdir(root)
sys.addaudithook(hook)
for number in range(int(sys.argv[2])):
    try:
        options = RenderOptions(pattern=f"{number}.exr", cache=number % 2 == 0)
        render_scene(RenderJob(Path(f"{number}.yaml"), options))
        print(number, "rendered")
    except IllumError as error:
        print(number, error.exit_code, str(error).splitlines()[0][:200])
print(found)
"""


def test_nothing_outside_is_opened_and_nothing_is_run(python, jail, tmp_path):
    import json

    scenes = []
    box = {"mesh": {"shape": "box"}, "material": "m"}
    for path in TRAVERSALS:
        scenes += [
            {"objects": [{"mesh": path if "." in path else {"file": path}}]},
            {"materials": {"m": {"model": "merl", "file": path}}, "objects": [box]},
            {"materials": {"m": {"model": "lambert", "diffuse": {"texture": path}}}, "objects": [box]},
            {"extends": path},
        ]  # fmt: skip
    scenes.append({"objects": [{"mesh": {"file": "m.obj", "materials": True}}]})  # its library lies outside
    sun = {"light": "directional", "direction": [-1, -2, -3]}
    around = {"version": 1, "film": {"width": 4, "height": 4, "samples": 1}, "lights": [sun]}
    for number, scene in enumerate(scenes):
        (jail / f"{number}.yaml").write_text(json.dumps({**around, **scene}))
    said = python(AUDITED, jail, len(scenes), ILLUM_CACHE=str(jail / "cache"))
    *lines, found = said.splitlines()
    assert found == "[]"
    assert len(lines) == len(scenes)
    for line, scene in zip(lines[:-1], scenes[:-1], strict=True):
        assert line.split()[1] == "2", (line, scene)
    assert lines[-1].split()[1] == "rendered"


def test_a_run_forks_and_calls_nobody(python, folder):
    (folder / "scene.yaml").rename(folder / "0.yaml")
    said = python(AUDITED, folder, 1, ILLUM_CACHE=str(folder / "cache"))
    assert said.splitlines() == ["0 rendered", "[]"]


OUTSIDE = [
    "../../x.png", "{top}/x.png", "out/x.png", "../../{{camera}}/x.exr", "link.png", "sub/../../../x.exr",
]  # fmt: skip


@pytest.mark.parametrize("pattern", OUTSIDE)
def test_a_scene_writes_where_it_may_read_alone(jail, tmp_path, monkeypatch, pattern):
    from illumcli.commands.check import check_scenes
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene
    from illumcli.scene.load import load

    monkeypatch.chdir(jail)
    (jail / "link.png").symlink_to(tmp_path / "target.png")
    written = pattern.format(top=tmp_path)
    text = (
        "version: 1\nambient: 1\nfilm: {width: 4, height: 4, samples: 1}\nobjects: [{mesh: {shape: box}}]\n"
    )
    scene = jail / "s.yaml"
    scene.write_text(f"{text}outputs:\n  files: ['{written}']\n")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(
        InputError, match=r"s\.yaml:6:11: outputs\.files\.0: .*lies outside .*--allow"
    ) as told:
        render_scene(RenderJob(scene, RenderOptions(cache=False, force=True)))
    assert check_scenes([scene]).problems == list(told.value.problems)
    assert sorted(tmp_path.rglob("*")) == before

    # the user's own word leads anywhere, and opens a folder to scenes
    paths, _ = render_scene(RenderJob(scene, RenderOptions(pattern=str(tmp_path / "mine.png"), cache=False)))
    paths += render_scene(
        RenderJob(scene, RenderOptions([f"outputs.files=[{tmp_path / 'over.png'}]"], cache=False))
    )[0]
    monkeypatch.setenv("ILLUM_ALLOW", str(tmp_path))
    paths += render_scene(RenderJob(scene, RenderOptions(cache=False, force=True)))[0]
    assert all(os.path.exists(os.path.realpath(path)) for path in paths)
    assert load(scene).scene.outputs.files == (written,)


def test_names_of_a_scene_hold_no_control_characters(folder):
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene

    for said in ("\\e[31mx.png", "a\\0.png", "a\\nb.png", "\\x9b.png"):
        text = (folder / "scene.yaml").read_text().partition("outputs:")[0]
        (folder / "s.yaml").write_text(f'{text}outputs: {{files: ["{said}"]}}\n')
        with pytest.raises(InputError, match=r"character U\+00(1B|00|0A|9B)"):
            render_scene(RenderJob(folder / "s.yaml", RenderOptions(cache=False)))


@pytest.mark.parametrize("pattern", ["x.png", "new/x.png", "../x.png", "../c/x.png", "{top}/a/b/x.png"])
def test_a_scene_writes_beside_itself_and_where_the_user_stands(jail, tmp_path, monkeypatch, pattern):
    from illumcli.commands.options import RenderJob, RenderOptions
    from illumcli.commands.render import render_scene

    monkeypatch.chdir(jail)
    (jail / "s.yaml").write_text(
        "version: 1\nambient: 1\nfilm: {width: 4, height: 4, samples: 1}\nobjects: [{mesh: {shape: box}}]\n"
        f"outputs: {{files: ['{pattern.format(top=tmp_path)}']}}\n"
    )
    paths, _ = render_scene(RenderJob(jail / "s.yaml", RenderOptions(cache=False)))
    assert all(path.exists() for path in paths)
