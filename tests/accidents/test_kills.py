"""Kill -9 at random moments of every command that writes: whole files or none, then the same bytes."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import sys
import time

import pytest

FILM = ("-D", "film={width: 160, height: 120, samples: 4}", "-t", "1", "-q", "--no-cache")
COMMANDS = {
    "render to exr": ("render", "scene.yaml", *FILM, "-o", "out/a.exr"),
    "render to png": ("render", "scene.yaml", *FILM, "-o", "out/{layer}.png"),
    "sweep": (
        "sweep", "scene.yaml", "-t", "1", "-q", "-D", "ambient=0.1:0.5:4", "-o", "out/{ambient}.png",
        "--only", "beauty", "--sheet", "out/sheet.png", "--table", "out/t.csv",
    ),
    "ao-bake to npz": ("ao-bake", "thing.obj", "-o", "out/a.npz", "--samples", "65536", "-q"),
    "ao-bake to ply": ("ao-bake", "thing.obj", "-o", "out/a.ply", "--samples", "65536", "-q"),
    "ao-bake to glb": ("ao-bake", "thing.obj", "-o", "out/a.glb", "--samples", "65536", "-q"),
    "compare --heat": ("compare", "a.png", "b.png", "--heat", "out/heat.png"),
    "converge": (
        "converge", "scene.yaml", "--width", "24", "--to", "8", "--repeats", "1", "-q", "-o", "out/c.svg",
    ),
    "brdf": ("brdf", "phong", "--view", "polar", "-o", "out/b.png", "--csv", "out/b.csv"),
}  # fmt: skip
SAME = {"t.csv": lambda text: len(text.splitlines()), "c.svg": lambda text: text.endswith("</svg>\n")}
"""What is the same in all runs, of files that hold seconds."""
FEW = ("sweep", "ao-bake to ply", "compare --heat", "brdf")


def files(folder):
    """Name -> content; or what is the same in all runs."""
    return {
        path.name: SAME[path.name](path.read_text()) if path.name in SAME else digest(path)
        for path in sorted((folder / "out").glob("[!.]*"))
    }


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("name", "count"),
    [(name, 2) for name in FEW] + [pytest.param(name, 40, marks=pytest.mark.slow) for name in COMMANDS],
)
def test_a_killed_command_leaves_whole_files_and_the_next_run_the_same_and_nothing_more(folder, name, count):
    command = [sys.executable, "-m", "illumcli", *COMMANDS[name]]
    env = {**os.environ, "ILLUM_CACHE": str(folder / "cache")}
    quiet = {"cwd": folder, "env": env, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    (folder / "out").mkdir()

    # what compare looks at, and what the command writes when nothing stops it
    for picture, ambient in (("a.png", "0.1"), ("b.png", "0.5")) if name == "compare --heat" else ():
        words = ("-D", f"ambient={ambient}", "--only", "beauty", "-o", picture)
        subprocess.run([*command[:3], "render", "scene.yaml", *words], check=True, **quiet)
    start = time.monotonic()
    subprocess.run(command, check=True, **quiet)
    seconds = time.monotonic() - start
    expected = files(folder)
    assert expected

    # killed at any moment, mostly while it writes; the files of one try are found by the next
    draw, ends = random.Random(len(name)), 0
    for number in range(count):
        if number % 4 == 0:
            for path in (folder / "out").iterdir():
                path.unlink()
        with subprocess.Popen(command, **quiet) as run:
            time.sleep(draw.uniform(0.3, 1.1) * seconds)
            run.send_signal(signal.SIGKILL)
        ends += run.returncode == -signal.SIGKILL
        found = files(folder)
        assert all(expected[path] == content for path, content in found.items()), (number, found)
    print(f"{name}: {count} tries, {ends} killed")  # pytest -rP shows it
    assert ends > count / 4 or count < 10

    # the next run
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert files(folder) == expected
    assert not list((folder / "out").glob(".*"))
