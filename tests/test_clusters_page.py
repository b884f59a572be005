"""The scripts of docs/clusters.md are run, with stand-ins for SLURM and GNU parallel."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(
    r"^```(?:bash|make)\n(.*?)^```", (ROOT / "docs/clusters.md").read_text(), flags=re.M | re.S
)
ILLUM = """#!/bin/sh
command=$1; shift
case $command in sweep) set -- -D 'film={{width: 32, height: 18, samples: 1}}' "$@";; esac
exec {python} -m illumcli "$command" "$@"
"""
PARALLEL = """#!{python}
# GNU parallel for `parallel -j 1 -I % COMMAND ::: WORDS`: the shell runs the command with each word.
import subprocess, sys
words = sys.argv[1:]
assert words[:4] == ["-j", "1", "-I", "%"], words
at = words.index(":::")
for word in words[at + 1 :]:
    subprocess.run(" ".join(words[4:at]).replace("%", word), shell=True, check=True)
"""


@pytest.fixture
def run(tmp_path):
    """Run a script in a folder with the scenes, and with `illum` on the path."""
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    (tmp_path / "bin").mkdir()
    for name, text in (("illum", ILLUM), ("parallel", PARALLEL)):
        program = tmp_path / "bin" / name
        program.write_text(text.format(python=shlex.quote(sys.executable)))
        program.chmod(0o755)

    def run(*command, **more):
        env = {
            **os.environ,
            "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
            "ILLUM_CACHE": str(tmp_path / "c"),
        }
        done = subprocess.run(
            command, cwd=tmp_path, env={**env, **more}, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done

    return run


def block(start):
    """The block of the page that contains a text."""
    (found,) = [text for text in BLOCKS if start in text]
    return found


def test_a_slurm_array_and_the_merge_after_it(run, tmp_path):
    script = block("#SBATCH --array")
    first, last = map(int, re.search(r"--array=(\d+)-(\d+)", script).groups())
    assert first == 1
    for number in range(first, last + 1):
        run("bash", "-c", script, SLURM_ARRAY_TASK_ID=str(number), SLURM_ARRAY_TASK_COUNT=str(last))
    run("bash", "-c", block("illum merge slurm"))
    assert len((tmp_path / "slurm/table.csv").read_text().splitlines()) == 1 + 12
    assert (tmp_path / "slurm/sheet.png").exists()


def test_gnu_parallel(run, tmp_path):
    run("bash", "-ec", block("parallel -j 1"))
    assert len(list((tmp_path / "parallel").glob("*.png"))) == 12


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_runs_what_is_missing(run, tmp_path):
    (tmp_path / "Makefile").write_text(block("made/table.csv"))
    run("make", "-j", "2", "made/table.csv")
    assert len((tmp_path / "made/table.csv").read_text().splitlines()) == 1 + 8
    assert "up to date" in run("make", "made/table.csv").stdout
    (tmp_path / "made/shard-2-of-3.json").unlink()
    again = run("make", "made/table.csv").stdout
    assert "--shard 2/3" in again
    assert "--shard 1/3" not in again
