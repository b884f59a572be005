"""Khronos' glTF validator, for tests of files: an npm package that runs in node."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest

_SCRIPT = """
const fs = require("fs"), validator = require("gltf-validator")
const validate = (file) => validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {maxIssues: 0})
Promise.all(process.argv.slice(1).map(validate)).then((all) => console.log(JSON.stringify(all)))
"""


@cache
def _modules() -> str | None:
    """The folder of node's packages, if the validator is among them."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        return None
    done = subprocess.run(["npm", "root", "--global"], capture_output=True, text=True, check=False)
    folder = done.stdout.strip()
    return folder if (Path(folder) / "gltf-validator").is_dir() else None


def validated(*paths: Path) -> list[dict[str, Any]]:
    """The reports of the validator: `issues`, with its messages, and `info`, with counts.

    The test is skipped where the validator is not installed.
    """
    modules = _modules()
    if modules is None:
        pytest.skip("npm's package gltf-validator is not installed: npm install --global gltf-validator")
    done = subprocess.run(
        ["node", "-e", _SCRIPT, *map(str, paths)],
        env={**os.environ, "NODE_PATH": modules},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def faults(path: Path) -> list[str]:
    """The errors and warnings of the validator: `CODE pointer`, one each."""
    messages = validated(path)[0]["issues"]["messages"]
    return [f"{each['code']} {each.get('pointer', '')}" for each in messages if each["severity"] < 2]
