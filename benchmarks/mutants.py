"""Do the tests of a module notice when it is changed?

Each of the modules that parse, check paths, keep and write files is changed in one place at a time: a
comparison swapped, a condition negated, `and` for `or`, a number one more or less, a word cut or longer, a
result gone, a statement left out; the prose of messages is left alone. Then its own tests run, in a copy of
the tree. A change that no test fails upon has survived: a missing test, dead code, or a change that makes no
difference (equivalent). Places are drawn with a fixed seed. Printed are the share found per module, and every
survivor.

    python benchmarks/mutants.py [COUNT] [SEED] [MODULE...]       # 30 of each module take 20 minutes
"""

from __future__ import annotations

import ast
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
READERS = "tests/mesh_files"
MODULES = {
    "files/atomic.py": ["tests/files/test_atomic.py"],
    "cache/fingerprint.py": ["tests/cache/test_fingerprint.py"],
    "images/exr.py": ["tests/images/test_images.py"],
    "images/reader.py": ["tests/images/test_images.py"],
    "files/names.py": ["tests/files/test_names.py"],
    "images/png.py": ["tests/images/test_png.py"],
    "cache/store.py": ["tests/cache/test_store.py"],
    "baking/files.py": ["tests/baking/test_files.py"],
    "mesh_files/gltf/write.py": ["tests/baking/test_files.py"],
    "visibility/baked.py": ["tests/visibility/test_baked.py"],
    "images/writer.py": ["tests/images/test_images.py", "tests/images/test_png.py"],
    "schema/faults.py": ["tests/scene/test_load.py"],
    "scene/load.py": ["tests/scene/test_load.py"],
    "scene/override.py": ["tests/scene/test_load.py"],
    "scene/references.py": ["tests/scene/test_load.py", "tests/scene/test_spec.py"],
    "scene/source.py": ["tests/scene/test_source.py"],
    "mesh_files/_files.py": [f"{READERS}/test_read_mesh.py", f"{READERS}/test_gltf.py"],
    "mesh_files/mtl.py": [f"{READERS}/test_mtl.py"],
    "mesh_files/_polygons.py": [f"{READERS}/test_{name}.py" for name in ("obj", "ply", "gltf", "read_mesh")],
    "mesh_files/_text.py": [f"{READERS}/test_{name}.py" for name in ("obj", "stl", "ply", "read_mesh")],
    "mesh_files/gltf.py": [f"{READERS}/test_gltf.py"],
    "mesh_files/obj.py": [f"{READERS}/test_obj.py", f"{READERS}/test_mtl.py"],
    "mesh_files/ply.py": [f"{READERS}/test_ply.py"],
    "mesh_files/stl.py": [f"{READERS}/test_stl.py"],
}
MEMORY = 8 << 30  # [bytes] of address space, for changes that make a program ask for all there is

SWAPPED = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult, ast.Div: ast.Mult,
    ast.Mod: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}  # fmt: skip


class Change(ast.NodeTransformer):
    """Makes the change of this number; `made` says which, `count` how many there are."""

    def __init__(self, wanted: int = -1) -> None:
        self.wanted, self.count, self.made = wanted, 0, ""

    def take(self, node: ast.AST, what: str) -> bool:
        """Is this the change to make?"""
        self.count += 1
        if self.count - 1 != self.wanted:
            return False
        self.made = f"line {node.lineno}: {what}"  # type: ignore[attr-defined]
        return True

    def visit(self, node: ast.AST) -> ast.AST:
        match node:
            case ast.FunctionDef() | ast.ClassDef() | ast.Module():
                documented = ast.get_docstring(node, clean=False) is not None
                node.body[documented:] = [self.visit(each) for each in node.body[documented:]]
                if isinstance(node, ast.FunctionDef):
                    node.args.defaults = [self.visit(each) for each in node.args.defaults]
                return node
            case ast.AnnAssign():
                node.value = node.value and self.visit(node.value)
                return node
            case ast.Expr(ast.Constant()) | ast.JoinedStr() | ast.Import() | ast.ImportFrom() | ast.Assert():
                return node
            case ast.Expr() | ast.AugAssign() | ast.Raise() if self.take(
                node, f"without {ast.unparse(node)}"
            ):
                return ast.copy_location(ast.Pass(), node)
            case ast.Return(value) if value is not None and self.take(node, "return None"):
                return ast.copy_location(ast.Return(ast.Constant(None)), node)
            case ast.If(test) | ast.While(test) | ast.IfExp(test) if self.take(
                node, f"not ({ast.unparse(test)})"
            ):
                node.test = ast.UnaryOp(ast.Not(), test)
                return node
            case ast.UnaryOp(ast.Not(), inner) if self.take(node, f"{ast.unparse(inner)}, not negated"):
                return inner
            case ast.Compare():
                for k, old in enumerate(node.ops):
                    if self.take(node, f"{type(old).__name__} swapped in {ast.unparse(node)}"):
                        node.ops[k] = SWAPPED[type(old)]()
            case ast.BoolOp(op) | ast.BinOp(op=op) if type(op) in SWAPPED:
                if self.take(node, f"{type(op).__name__} swapped in {ast.unparse(node)}"):
                    node.op = SWAPPED[type(op)]()
            case ast.Constant(value):
                return self.other(node, value)
        return self.generic_visit(node)

    def other(self, node: ast.Constant, value: object) -> ast.AST:
        match value:
            case bool():
                changed: list[object] = [not value]
            case int() | float():
                changed = [value + 1, value - 1]
            case str() | bytes() if value and len(value.split()) == 1:
                changed = [value[:0], value + value[:1]]
            case _:
                changed = []
        for each in changed:
            if self.take(node, f"{value!r} is {each!r}"):
                return ast.copy_location(ast.Constant(each), node)
        return node


def mutants(text: str, count: int, seed: int) -> Iterator[tuple[str, str]]:
    """What is changed and the changed program, `count` times or as often as there are places."""
    everything = Change()
    everything.visit(ast.parse(text))
    for number in sorted(random.Random(seed).sample(range(everything.count), min(count, everything.count))):
        change = Change(number)
        tree = change.visit(ast.parse(text))
        yield change.made, ast.unparse(ast.fix_missing_locations(tree))


def passes(folder: Path, tests: list[str], most: float) -> bool:
    """Do the tests pass within `most` seconds?"""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", *tests]
    env = {**os.environ, "PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            words, cwd=folder, env=env, capture_output=True, check=False, timeout=most,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def main() -> None:
    """Print the share of changes found, per module, and the survivors."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    chosen = sys.argv[3:] or list(MODULES)
    found_all = made_all = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "tree"
        for part in ("src", "tests", "scenes", "schemas", "benchmarks", "pyproject.toml"):
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
            folder.mkdir(exist_ok=True)
            copy(ROOT / part, folder / part)
        for module in chosen:
            path = folder / "src" / "illumcli" / module
            text = path.read_text()
            start = time.monotonic()
            if not passes(folder, MODULES[module], 600):
                sys.exit(f"{module}: its tests fail before any change")
            most = 5 * (time.monotonic() - start) + 10
            survivors, made = [], 0
            for what, changed in mutants(text, count, seed):
                made += 1
                path.write_text(changed)
                if passes(folder, MODULES[module], most):
                    survivors.append(what)
            path.write_text(text)
            found_all, made_all = found_all + made - len(survivors), made_all + made
            seconds = time.monotonic() - start
            print(f"{module:32}{made - len(survivors):4d} of {made:3d}  {seconds:5.0f} s", flush=True)
            for what in survivors:
                print(f"    {' '.join(what.split())[:150]}", flush=True)
    print(f"{'all':32}{found_all:4d} of {made_all:3d}  {found_all / made_all:.1%}")


if __name__ == "__main__":
    main()
