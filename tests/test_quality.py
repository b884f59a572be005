"""Format, lint and types: what CI checks beside behaviour."""

from __future__ import annotations

import ast
import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    "words",
    [
        ("ruff", "check", "--no-cache", "."),
        ("ruff", "format", "--no-cache", "--check", "."),
        ("mypy", "--cache-dir=/dev/null"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_the_tree_is_clean(root, words):
    done = subprocess.run(
        [sys.executable, "-m", *words], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


MOST_PARAMETERS = 6
"""More that travel together are a record; the functions of click commands have one for every option."""
MOST_LINES = 150
"""Of a file in `commands/`, which reads like a table of contents."""


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Number of a function's parameters, without `self` and `cls`."""
    given = function.args
    names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return sum(name not in ("self", "cls") for name in names) + bool(given.vararg) + bool(given.kwarg)


def is_command(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Is it decorated as a command of click?"""
    return any(ast.unparse(each).startswith("click.command") for each in function.decorator_list)


def test_what_travels_together_is_a_record(root):
    long = []
    for path in sorted((root / "src/illumcli").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or is_command(node):
                continue
            if parameters(node) > MOST_PARAMETERS:
                long.append(f"{path.relative_to(root)}:{node.lineno}: {node.name} takes {parameters(node)}")
    assert not long, "\n".join(long)


def test_commands_read_like_a_table_of_contents(root):
    lines = {
        path.name: len(path.read_text().splitlines())
        for path in (root / "src/illumcli/commands").glob("*.py")
    }
    assert not {name: count for name, count in lines.items() if count > MOST_LINES}
