"""Who may import whom, and what start-up costs: read from the imports, and from fresh processes."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "illumcli"
MODULES = sorted(SOURCE.rglob("*.py"))

FOLDERS = (
    "cli",
    "stress",
    "cluster viewer",
    "api",
    "commands",
    "fitting",
    "accuracy baking brdf gonioreflectometer html_report verification",
    "render_graph",
    "cache",
    "scene",
    "shading images",
    "visibility mesh_files",
    "film",
    "rays files",
    "lights models geometry atlas",
    "measured_files schema",
)
"""From the top down: a folder imports from those below its line, and from single files beside them."""
LEVEL = {folder: level for level, line in enumerate(FOLDERS) for folder in line.split()}
HOMES = {
    "click": ("cli",),
    "yaml": ("scene/source.py",),
    "pydantic": (
        "schema/",
        "scene/",
        "models/",
        "lights/",
        "geometry/shapes/",
        "visibility/falloffs/",
        "commands/schema_generator.py",
        "brdf/",
        "viewer/",
    ),
    "pydantic_core": ("nowhere: it is no dependency of ours",),
    "embreex": ("rays/",),
    "OpenImageIO": ("images/openimageio.py",),
    "xatlas": ("atlas/xatlas_process.py",),
    "distributed": ("cluster/",),
    "dask": ("cluster/",),
    "jinja2": ("html_report/",),
    "websockets": ("viewer/server.py",),
    "matplotlib": ("brdf/", "accuracy/", "fitting/figure.py", "images/sheet_drawing.py"),
    "scipy": ("fitting/",),
}


def imports(path: Path) -> set[str]:
    tree = ast.parse(path.read_text())
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def layer(path: Path) -> str:
    parts = path.relative_to(SOURCE).parts
    return parts[0] if len(parts) > 1 else path.stem


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(SOURCE)))
def test_imports_go_one_way(path):
    place, own = str(path.relative_to(SOURCE)), layer(path)
    for name in imports(path):
        if name.startswith("illumcli."):
            other = name.split(".")[1]
            if other not in LEVEL or other == own or own in ("__init__", "__main__"):
                continue
            assert own in LEVEL, f"{place} imports {name}, and stands beside the folders"
            assert LEVEL[own] < LEVEL[other], f"{place} imports {name}"
        home = HOMES.get(name.split(".")[0])
        if home:
            assert place.startswith(home), f"{place} imports {name}, which lives in {home}"


def loaded_after(code: str) -> set[str]:
    script = f"import sys\n{code}\nprint(' '.join(m.partition('.')[0] for m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_help_loads_nothing_heavy():
    code = "from illumcli.cli import illum\ntry:\n    illum(['--help'])\nexcept SystemExit: pass"
    assert not loaded_after(code) & {"numpy", "pydantic", "yaml", "embreex", "OpenImageIO"}


def test_a_scene_imports_and_builds_only_what_it_names():
    code = """
from illumcli.scene.spec import Scene
from illumcli.schema.description import Description
thing = {"mesh": {"shape": "sphere"}, "material": {"model": "phong"}}
light = {"light": "point", "position": [0, 1, 2]}
Scene.model_validate({"version": 1, "objects": [thing], "lights": [light]})
families = ("illumcli.models.", "illumcli.lights.")
members = [name for name in sys.modules if name.startswith(families) and "._" not in name]
assert members == ["illumcli.models.phong", "illumcli.lights.point"], members
classes = Description.__subclasses__()
for cls in classes:
    classes += cls.__subclasses__()
built = {cls.__name__ for cls in classes if cls.__pydantic_complete__}
assert built == {"Scene", "Sphere", "Phong", "Point"}, built
"""
    loaded_after(code)


def test_plan_loads_no_ray_core(root):
    scene = next(iter(sorted((root / "scenes").glob("*.yaml"))))
    code = (
        f"from illumcli.cli import illum\ntry:\n    illum(['plan', {str(scene)!r}])\nexcept SystemExit: pass"
    )
    assert not loaded_after(code) & {"embreex", "OpenImageIO"}


def test_only_a_fit_loads_scipy(root, tmp_path):
    command = "from illumcli.cli import illum\ntry:\n    illum({words})\nexcept SystemExit: pass"
    table = str(root / "scenes" / "satin.csv")
    for words in (["fit", "--help"], ["models"], ["brdf", "lambert", "--csv", str(tmp_path / "l.csv")]):
        assert not loaded_after(command.format(words=words)) & {"scipy"}, words
    assert "scipy" in loaded_after(command.format(words=["fit", table, "--model", "lambert", "-q"]))


def test_a_plain_render_loads_no_costs_audits_or_sweeps(tmp_path):
    scene = tmp_path / "s.yaml"
    scene.write_text("version: 1\nobjects: [{mesh: {shape: box}}]\nfilm: {width: 8, height: 6, samples: 1}\n")
    code = f"""
from illumcli.cli import illum
try:
    illum(["render", {str(scene)!r}, "-o", {str(tmp_path / "s.png")!r}, "--no-cache"])
except SystemExit as end:
    assert end.code == 0
late = ("illumcli.render_graph.costs", "illumcli.accuracy", "illumcli.html_report", "illumcli.scene.variants")
late += ("scipy", "illumcli.fitting")
late += tuple(f"illumcli.commands.{{name}}" for name in ("bands", "merge", "plan", "sharding", "sweep"))
loaded = [name for name in sys.modules if name.startswith((*late, "OpenImageIO"))]
assert not loaded, loaded
"""
    loaded_after(code)


def test_a_render_loads_no_material_or_library_that_it_does_not_use(tmp_path):
    scene = tmp_path / "s.yaml"
    scene.write_text(
        "version: 1\nobjects: [{mesh: {shape: teapot}, material: {model: phong}}]\nambient: 1\n"
        "obscurance: {samples: 1}\nfilm: {width: 8, height: 6, samples: 1}\n"
    )
    code = f"""
import sys
sys.argv = ["illum", "render", {str(scene)!r}, "-o", {str(tmp_path / "s.png")!r}, "--no-cache"]
from illumcli.cli import illum
try:
    illum()
except SystemExit as end:
    assert end.code == 0
unused = ("illumcli.models.lambert", "numpy.ma")  # the default material; masked arrays, 10 ms
assert not set(unused) & set(sys.modules), set(unused) & set(sys.modules)
"""
    loaded_after(code)


def test_what_a_mesh_file_names_is_found_without_its_reader(tmp_path):
    for suffix in ("obj", "ply", "gltf", "stl"):
        (tmp_path / f"m.{suffix}").write_text("mtllib m.mtl\n")
    code = f"""
from pathlib import Path
from illumcli.mesh_files import companions
found = [companions(Path({str(tmp_path)!r}) / name) for name in ("m.obj", "m.ply", "m.gltf", "m.stl")]
assert [len(files) for files in found] == [1, 0, 0, 0], found
readers = {{f"illumcli.mesh_files.{{name}}" for name in ("obj", "mtl", "ply", "gltf", "stl", "_text")}}
assert not readers & set(sys.modules), readers & set(sys.modules)
"""
    loaded_after(code)
