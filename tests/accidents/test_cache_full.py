"""A cache folder that fills up during renders: the same bytes, one warning, no incomplete entry."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

SLOW = pytest.mark.slow
RENDER = """
import hashlib, resource, subprocess, sys
from pathlib import Path

# every artifact is kept, however fast it was made
CLI = "from illumcli.cache import policy as artifacts; artifacts.worth = lambda seconds, size: True\\n" \\
      "from illumcli.cli import illum; illum()"

def render(name, *words):
    command = [sys.executable, "-c", CLI, "render", "scene.yaml", "--only", "beauty", "-q", "-o", name]
    command += words
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return hashlib.sha256(Path(name).read_bytes()).hexdigest(), done.stderr.splitlines()

whole, silence = render("plain.png", "--no-cache")
assert silence == [], silence
"""

LIMITED = (
    RENDER
    + """
# below this no picture could be written either
least, hard = Path("plain.png").stat().st_size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]
for k, limit in enumerate((least + 64, 30_000)):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    for again in range(2):
        found, told = render(f"limited-{k}-{again}.png")
        assert found == whole, (limit, again)
        assert len(told) == 1 and "cache:" in told[0] and "cannot be written" in told[0], told
resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
found, told = render("free.png")
assert (found, told) == (whole, []), told
found, told = render("warm.png")
assert (found, told) == (whole, []), told
"""
)

TINY = (
    RENDER
    + """
for again in range(3):
    found, told = render(f"tiny-{again}.png")
    assert found == whole, again
    assert len(told) == 1 and "cache:" in told[0], told
import os
left = [name for _, _, names in os.walk(os.environ["ILLUM_CACHE"]) for name in names]
assert not [name for name in left if "part" in name], left
"""
)


def test_files_of_a_limited_size(python, folder):
    python(LIMITED)


@pytest.mark.parametrize("size", [pytest.param("16k", marks=SLOW), "64k", pytest.param("200k", marks=SLOW)])
def test_a_tiny_file_system(folder, size):
    place = folder / "cache"
    place.mkdir()
    mount = f"mount -t tmpfs -o size={size} none {place}"
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([unshare, "-rm", "sh", "-c", mount], capture_output=True).returncode:
        pytest.skip("may not mount a file system of its own here")
    done = subprocess.run(
        [unshare, "-rm", "sh", "-c", f'{mount} && exec "$0" -c "$1"', sys.executable, TINY],
        cwd=folder, env={**os.environ, "ILLUM_CACHE": str(place)}, capture_output=True, text=True,
        timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
